"""The example of docs/faults.md, run small, and what the page says of keys, invariants and columns."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from steptwin.features.campaigns.campaign import Campaign, read_campaign
from steptwin.features.campaigns.invariants import INVARIANTS
from steptwin.features.campaigns.row import Ended, schema
from steptwin.features.campaigns.running import run_seed
from steptwin.features.campaigns.sources import sources_of_file
from steptwin.features.campaigns.trial import draw
from steptwin.features.campaigns.values import drawn, read_template
from steptwin.features.campaigns.variations import VARIATIONS, RampSource
from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds import DOCUMENTED
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.features.faults.moment import AxisMoment, Moment
from steptwin.features.faults.requests import REQUESTS, read_request
from steptwin.features.motors.options import MotorsTurn
from steptwin.host.common.choices import STATE
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import DigitalInput, State
from tests.features.campaigns.campaigns import campaign_of
from tests.messages import refusing

WHEN = {"at_s", "power_up_s", "at_position", "at_state", "on_frame", "for_s", "until"}
"""Keys of a fault that say when it is."""
PAGE = (Path(__file__).parents[3] / "docs" / "faults.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def evening(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    text = PAGE.partition("<!-- evening -->\n```toml\n")[2].partition("```")[0]
    return campaign_of(text.replace("runs = 1000", "runs = 1000\nrecover = false"), tmp_path_factory.mktemp("page"))


@pytest.mark.slow
def test_the_evening_runs(evening: Campaign) -> None:
    """One run of each scenario, of the shortest motions among the first."""
    trials = {}
    for trial in sorted((draw(evening, seed) for seed in range(40)), key=lambda trial: -trial.motion.duration_s):
        trials[trial.scenario] = trial
    assert len(trials) == len(evening.scenario) == 4
    for trial in trials.values():
        row = run_seed(evening, trial.seed)
        assert row.ended in (Ended.DONE, Ended.STOPPED)
        assert (row.breaches, all(row.struck)) == ((), True), row


@pytest.mark.slow
def test_the_campaign_of_the_ar4_runs(tmp_path: Path) -> None:
    """One run of each scenario of the example, its motors turned by what the drivers did."""
    text = (Path(__file__).parents[3] / "docs/examples/campaigns/ar4.toml").read_text(encoding="utf-8")
    campaign = campaign_of(text.replace("runs = 200", "runs = 200\nrecover = false"), tmp_path)
    trials = {}
    for trial in sorted((draw(campaign, seed) for seed in range(30)), key=lambda trial: -trial.motion.duration_s):
        trials[trial.scenario] = trial
    assert len(trials) == len(campaign.scenario) == 4
    for trial in trials.values():
        row = run_seed(campaign, trial.seed)
        assert (trial.setup.robot.name, row.breaches, all(row.struck)) == ("ar4-mk3", (), True), row


@pytest.fixture(scope="module")
def nightly() -> Campaign:
    campaign, files = read_campaign(sources_of_file("nightly"))
    assert (campaign.runs, files) == (10_000, set())
    assert len(campaign.robots) == 6
    return campaign


@pytest.mark.slow
def test_the_nightly_campaign_can_be_drawn(nightly: Campaign) -> None:
    for seed in range(40):
        trial = draw(nightly, seed)
        trial.scenario_in(trial.plan())


def _faults(campaign: Campaign) -> Iterator[tuple[Robot, int, Fault]]:
    """Yield the faults of every scenario, drawn some times, with the number of boards."""
    for choice in campaign.scenario:
        for number in range(8 if choice.table else 0):
            robot = campaign.robots[choice.robots[number % len(choice.robots)]]
            table = drawn(choice.table, Random(f"{choice.name} {number}"), robot)
            for keys in table["fault"]:
                fault = read_request(robot, {key: value for key, value in keys.items() if key not in {"name", *WHEN}})
                assert fault is not None
                yield robot, len(choice.vary["crystal_ppm"]) if "two boards" in choice.name else 1, fault


def test_the_nightly_campaign_has_every_fault(nightly: Campaign) -> None:
    """Each kind of request, each fault of a host, and each row of documented reactions.

    That is so whichever way axes move, and whether or not their drivers' fault outputs are wired.
    """
    asked = {fault["do"] for choice in nightly.scenario if choice.table for fault in choice.table["fault"]}
    assert asked == set(REQUESTS) - {STATE}
    rows, hosts = set(), set()
    for number, (robot, boards, fault) in enumerate(_faults(nightly)):
        velocity = 100 if number % 2 else -100
        axis = AxisMoment(
            State.OPERATION_ENABLED,
            True,
            velocity,
            100,
            position_known=True,
            lag_full_steps=0,
            fault_input=DigitalInput.DRIVER_FAULT if number // 2 % 2 else None,
        )
        axes = tuple(replace(axis, board=joint % boards) for joint in range(len(robot.joints)))
        rows.add(fault.documented(Moment(0, axes, robot.board.bitrate)).what)
        if isinstance(fault, HostFault):
            hosts.add(fault.kind)
    assert hosts == set(HostFaultKind)
    assert rows == {row.what for row in DOCUMENTED}


@pytest.mark.slow
def test_the_nightly_campaign_has_crystals_boards_and_motors(nightly: Campaign) -> None:
    """What faults.md has beside the table: a crystal that is off, boards that drift apart, motors that feel a load."""
    trials = [
        draw(replace(nightly, scenario=(each,), robots={name: nightly.robots[name] for name in each.robots}), seed)
        for seed, each in enumerate(nightly.scenario)
    ]
    assert {len(trial.setup.crystals_ppm) for trial in trials} == {1, 2}
    assert {any(trial.setup.crystals_ppm) for trial in trials if trial.setup.axes_per_board is None} == {True, False}
    assert {trial.motors for trial in trials} == {None, MotorsTurn.IN_LOOP}
    turning = [trial.setup for trial in trials if trial.motors is MotorsTurn.IN_LOOP]
    assert {setup.ramps for setup in turning} == {RampSource.MOTORS}
    assert {joint.transmission.microsteps for setup in turning for joint in setup.robot.joints} <= {8, 16}


def test_every_invariant_parameter_and_column_is_on_the_page() -> None:
    table = PAGE.partition("### What must hold")[2].partition("\n### ")[0]
    assert re.findall(r"^\| (\w+) \|", table, flags=re.MULTILINE)[1:] == list(INVARIANTS)
    columns = PAGE.partition("| column | is |")[2]
    for name in schema().names:
        assert f"`{name}`" in columns, name
    for name in VARIATIONS:
        assert f"`{name}`" in PAGE, name


def test_every_draw_is_on_the_page() -> None:
    table = PAGE.partition("| drawn value | is |")[2].partition("\n\n")[0]
    kinds = re.findall(r"\{ (\w+) = ", table)
    assert len(kinds) == 7
    for kind in kinds:
        with refusing(InputError):
            read_template({kind: "nonsense"})
