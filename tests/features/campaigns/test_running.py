"""Runs of a campaign: the same row every time, whatever goes wrong is in it, and each invariant can be broken."""

from collections.abc import Callable, Iterator
from dataclasses import fields, make_dataclass, replace
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np
import pytest

from steptwin.features.campaigns import running
from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.invariants import INVARIANTS, breaches_of
from steptwin.features.campaigns.margins import Claim, Performance, all_margins
from steptwin.features.campaigns.recovery import Recovery, steps_off
from steptwin.features.campaigns.row import Ended
from steptwin.features.campaigns.running import perform, run_seed, run_trial
from steptwin.features.campaigns.trial import draw
from steptwin.features.faults.reaction import GOES_ON, RUN_DRY, stops
from steptwin.features.faults.report import FaultReport, ScenarioReport, report_in
from steptwin.features.motors.options import MotorsTurn
from steptwin.features.motors.turning import JointLoad, MotorVerdict
from steptwin.features.motors.turning.verdict import ToolReached
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.verify import AxisEvidence, figures, verify_comparison
from steptwin.host.verify.figures import AxisReport, AxisRun, FigureLimit, ReportFigure
from steptwin.protocol.drivers import bare_chip
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from tests.features.campaigns.campaigns import SMALL, campaign_of


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return campaign_of(SMALL, tmp_path_factory.mktemp("small"))


@pytest.fixture(scope="module")
def seeds(small: Campaign) -> dict[str, int]:
    """The first seed of each scenario."""
    return {draw(small, seed).scenario: seed for seed in reversed(range(20))}


def _motors(**changes: Any) -> MotorVerdict:
    """Return a verdict in which a joint kept step, unless the changes say otherwise."""
    figures: dict[str, Any] = {field.name: 0.25 for field in fields(JointLoad)} | {"name": "th1", "first_slip_s": None}
    reached, load, chip = ToolReached(0.0, 0.0, 0.0, 0.0, 0.0), JointLoad(**figures | changes), bare_chip(330).chip
    return MotorVerdict(0.3, 24.0, 23.9, 24.1, reached, (load,), chip)


@pytest.fixture(scope="module")
def healthy(small: Campaign, seeds: dict[str, int]) -> Iterator[Performance]:
    """A run without a fault, the recovery after it, and motors that kept step: turning them has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running, "motors_of_run", lambda *_, **__: SimpleNamespace(verdict=_motors()))
        yield perform(replace(draw(small, seeds["nothing"]), recover=True, motors=MotorsTurn.AFTER))


@pytest.fixture(scope="module")
def stopped(small: Campaign, seeds: dict[str, int]) -> Performance:
    return perform(replace(draw(small, seeds["emergency stop"]), recover=True))


def test_a_healthy_run_breaks_nothing(healthy: Performance) -> None:
    assert (healthy.ended, healthy.message, breaches_of(healthy)) == (Ended.DONE, "", ())
    assert healthy.recovery == Recovery()
    assert len(healthy.claims) == 4
    assert {name for name, margin in all_margins().items() if margin.of(healthy) is not None} == {*all_margins()} - {
        "standstill"
    }


@pytest.mark.parametrize(("verified", "told"), [(True, {"threshold", "step rate"}), (False, set())])
def test_what_a_board_cannot_know_tells_no_margin_of_its_axes(
    healthy: Performance, verified: bool, told: set[str]
) -> None:
    assert healthy.outcome is not None
    fault = FaultReport("it", {}, "at once", reaction=replace(GOES_ON, verified=verified))
    outcome = replace(healthy.outcome, verdicts={"faults": ScenarioReport("one", 1, (fault,), ())})
    run = replace(healthy, outcome=outcome)
    of_axes = ("threshold", "step rate")
    assert {name for name in of_axes if all_margins()[name].of(run) is not None} == told


def test_a_figure_with_a_limit_is_a_margin_of_the_row(healthy: Performance, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is declared in one place: as a figure of the axes' report."""
    ended = FigureLimit("travel", "steps at the end, of a million", lambda *_: 1e6)
    figure = ReportFigure[AxisRun]("steps at the end", lambda axis: abs(axis.counted.end_steps), limit=ended)
    wider = make_dataclass("Wider", [("travel_steps", Annotated[int, figure])], bases=(AxisReport,), frozen=True)
    monkeypatch.setattr(figures, "AxisReport", wider)
    assert healthy.outcome is not None
    report = verify_comparison(healthy.outcome.comparison, healthy.outcome.report.run)
    row = running.row_of(replace(healthy, outcome=replace(healthy.outcome, report=report)))
    most = max(abs(axis.steps_end) for axis in report.axes)
    assert list(row.margins)[:3] == ["travel", "threshold", "step rate"]
    assert row.margins["travel"] == pytest.approx(1 - most / 1e6)
    assert all_margins()["travel"].what == "steps at the end, of a million"


def test_a_stopped_run_says_so_and_breaks_nothing(stopped: Performance) -> None:
    row = running.row_of(stopped)
    assert (row.ended, row.breaches, row.codes[-1]) == (Ended.STOPPED, (), "0x9000")
    assert (row.faults, row.struck, row.met) == (("1 estop",), (1,), ("emergency stop pressed",))
    assert 0 < row.margins["standstill"] < 1
    assert set(row.margins) == {"bus", "standstill"}


@pytest.mark.slow
def test_a_seed_gives_the_same_row(small: Campaign, seeds: dict[str, int], stopped: Performance) -> None:
    """The recovery included, in which a program is in charge of the machine."""
    assert run_trial(replace(draw(small, seeds["emergency stop"]), recover=True)) == running.row_of(stopped)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("comparison", "failed"), [(1, "homing found another position"), (2, "a motor did not follow a move")]
)
def test_a_motor_that_is_elsewhere_after_the_recovery_is_told_by_what_brought_it_there(
    comparison: int, failed: str, small: Campaign, seeds: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last joint is found three steps off after homing, or not before the move."""
    comparisons = []

    def off(board: EmbeddedBoard, units: list[int]) -> list[float]:
        comparisons.append(units)
        steps = steps_off(board, units)
        return [*steps[:-1], 3.0] if len(comparisons) == comparison else steps

    monkeypatch.setattr("steptwin.features.campaigns.recovery.steps_off", off)
    run = perform(replace(draw(small, seeds["nothing"]), recover=True))
    told = "th4: its motor stands +3 steps from where its drive reports it; homing may be off by up to 1"
    assert run.recovery == Recovery(failed, told)


def _with_pulse_while_off(run: Performance) -> Performance:
    """Return the run with one rise of STEP before the drive was first enabled."""
    axis = run.axes[0]
    first = int(axis.pins["enable"].counts[0])
    rises = np.concatenate([[first - 1], axis.clk_rise_counts])
    return replace(run, axes=(replace(axis, clk_rise_counts=rises), *run.axes[1:]))


def _with_report(run: Performance, *reasons: str) -> Performance:
    assert run.outcome is not None
    return replace(run, outcome=replace(run.outcome, report=replace(run.outcome.report, reasons=reasons)))


def _with_fault(run: Performance, **changes: Any) -> Performance:
    assert run.outcome is not None
    scenario = report_in(run.outcome.verdicts)
    assert scenario is not None
    changed = replace(scenario, faults=(replace(scenario.faults[0], **changes),))
    return replace(run, outcome=replace(run.outcome, verdicts={"faults": changed}))


def _with_claim(run: Performance, off_steps: float, *, known: bool = True) -> Performance:
    return _with_claims(run, Claim("th1", known, off_steps))


def _with_claims(run: Performance, first: Claim) -> Performance:
    return replace(run, claims=(first, *run.claims[1:]))


BROKEN: dict[str, tuple[str, Callable[[Performance], Performance]]] = {
    "steps": ("healthy", lambda run: _with_report(run, "th1: unmatched steps 3 (limit 0)")),
    "verifier": ("healthy", lambda run: _with_claim(run, 4.0, known=False)),
    "power": ("healthy", _with_pulse_while_off),
    "position": ("stopped", lambda run: _with_claim(run, -0.6)),
    "standstill": ("stopped", lambda run: _with_fault(run, standstill_ms=700.0)),
    "stream": ("stopped", lambda run: replace(run, message="th1: ran out of records at rest before the end")),
    "answer": ("stopped", lambda run: _with_fault(run, differences=("th1: no EMCY 0x9000 after 3.5 ms",))),
    "recovery": ("healthy", lambda run: replace(run, recovery=Recovery("homing failed", "th1: time-out"))),
    "motors": ("healthy", lambda run: replace(run, motors=_motors(first_slip_s=0.1))),
}


@pytest.mark.parametrize("name", BROKEN)
def test_each_invariant_can_be_broken(healthy: Performance, stopped: Performance, name: str) -> None:
    which, broken = BROKEN[name]
    run = {"healthy": healthy, "stopped": stopped}[which]
    assert name not in {breach.invariant for breach in breaches_of(run)}
    assert name in {breach.invariant for breach in breaches_of(broken(run))}


def test_every_invariant_is_tried() -> None:
    assert {*BROKEN, "program"} == set(INVARIANTS)


def test_a_fault_that_keeps_points_away_explains_a_stream_that_ran_dry(stopped: Performance) -> None:
    dry = replace(stopped, message="th1: ran out of records at rest before the end of its stream")
    late_host = stops(*RUN_DRY, begins_ms=inf, certain=False)
    assert set(_details(dry)) == {"stream"}
    assert _details(_with_fault(dry, reaction=late_host)) == {}


def test_what_may_be_is_no_breach(healthy: Performance, stopped: Performance) -> None:
    """An unknown position may be wrong; after a stop the steps are not as planned; half a step is rounding."""
    assert breaches_of(_with_claim(stopped, -30.0, known=False)) == ()
    assert breaches_of(_with_report(stopped, "th1: end count 3 (planned 5)")) == ()
    assert breaches_of(_with_claim(healthy, 0.5)) == ()


def test_findings_are_alike_whatever_their_numbers(stopped: Performance) -> None:
    (breach,) = breaches_of(_with_fault(stopped, differences=("th1: no EMCY 0x9000 after 3.5 ms",)))
    assert breach.what == "JOINT: no EMCY 0x9000 after N ms"
    assert breach.detail == "1 estop: th1: no EMCY 0x9000 after 3.5 ms"


def test_a_run_that_cannot_be_made_says_why(small: Campaign, seeds: dict[str, int]) -> None:
    trial = replace(draw(small, seeds["nothing"]), scenario="x", table={"fault": [{"do": "estop", "at_s": 0.1}]})
    row = run_trial(trial)
    assert (row.ended, row.message, row.passed) == (Ended.REFUSED, "x: fault 1: pressed: is missing", True)


def test_a_program_that_fails_is_a_breach(
    small: Campaign, seeds: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by 0")

    monkeypatch.setattr(running, "execute", broken)
    row = run_seed(small, seeds["nothing"])
    assert (row.ended, row.message) == (Ended.CRASHED, "by 0")
    assert row.cause == "program: ZeroDivisionError in broken, after no fault"


def test_pulses_are_looked_at_from_power_up_to_the_end(healthy: Performance) -> None:
    """The recovery homes every axis: the evidence has its pulses, far more than the run's own."""
    assert healthy.outcome is not None
    own = healthy.outcome.comparison.evidence.axes

    def pulses(axes: tuple[AxisEvidence, ...]) -> int:
        return sum(axis.clk_rise_counts.size for axis in axes)

    assert pulses(healthy.axes) > 2 * pulses(own) > 0


def test_a_drawn_run_that_no_robot_can_make_is_refused(tmp_path: Path) -> None:
    campaign = campaign_of(SMALL.replace("record_ms = { choose = [5, 10] }", "stretch = 0.01"), tmp_path)
    trial = draw(campaign, 0)
    row = run_trial(replace(trial, slowable=False))
    assert row.ended is Ended.REFUSED
    assert "more than the driver's 15.0 kHz" in row.message
    assert trial.plan().motion.duration_s > 0.5 * trial.motion.duration_s  # random moves are slowed down


@pytest.mark.parametrize(("rotor", "off"), [(232.9, 30.0), (198.04, -2.0), (194.0, -2.0), (190.1, -10.0)])
def test_a_rotor_that_has_slipped_counts_by_whole_cycles(rotor: float, off: float) -> None:
    """Its load angle does not count: in half steps a cycle has 8."""
    joint = SimpleNamespace(transmission=SimpleNamespace(microsteps=2))
    robot = SimpleNamespace(joints=[joint], axes=[joint])
    board: Any = SimpleNamespace(robot=robot, motor_positions=lambda: [230.0], rotor_positions=lambda: [rotor])
    board.held_positions = lambda: EmbeddedBoard.held_positions(board)
    assert steps_off(board, [200 * UNITS_PER_FULL_STEP // 2]) == [off]


def test_a_rotor_that_slips_by_itself_is_no_step_that_the_verifier_has_missed(healthy: Performance) -> None:
    """Not even after the motion, when slips are no longer counted; a step that its driver has lost besides is one."""
    slipped = Claim("th1", known=True, off_steps=-64.0, slipped_steps=-64.0)
    claims_only = {
        "position": "th1: its motor stands -64 steps from the position that its drive reports; 0.5 is rounding"
    }
    assert _details(_with_claims(healthy, slipped)) == claims_only
    assert _details(_with_claims(healthy, replace(slipped, known=False))) == {}
    told = _details(_with_claims(healthy, replace(slipped, off_steps=-63.0)))
    assert told == {
        "verifier": "th1: its motor is +1 steps away, and the verifier counted every step; 0.5 is rounding",
        "position": "th1: its motor stands -63 steps from the position that its drive reports; 0.5 is rounding",
    }
    both = replace(_with_claims(healthy, slipped), motors=_motors(first_slip_s=0.1))
    assert set(_details(both)) == {"position", "motors"}


def _details(run: Performance) -> dict[str, str]:
    return {breach.invariant: breach.detail for breach in breaches_of(run)}


@pytest.mark.parametrize(("rotor", "made", "slipped"), [(232.9, 0, 0.0), (198.0, 0, -32.0), (198.0, -16, 0.0)])
def test_a_slip_on_purpose_is_none_that_a_rotor_makes_by_itself(rotor: float, made: int, slipped: float) -> None:
    """In half steps: an electrical cycle, 4 full steps, has 8 of them."""
    transmission = SimpleNamespace(microsteps=2)
    board: Any = SimpleNamespace(
        robot=SimpleNamespace(axes=[SimpleNamespace(transmission=transmission)]),
        motor_positions=lambda: [230.0],
        rotor_positions=lambda: [rotor],
        _machine=SimpleNamespace(simulation=SimpleNamespace(boards=[SimpleNamespace(slipped_full_steps=[made])])),
    )
    board.held_positions = lambda: EmbeddedBoard.held_positions(board)
    assert EmbeddedBoard.rotor_slips(board) == [slipped]


STEEP = """
runs = 1
robots = ["calibration-scara"]
recover = false
motors = "loop"

[[motion]]
moves = 1
reach = 0.05

[[scenario]]
name = "emergency stop"
[[scenario.fault]]
do = "estop"
pressed = true
at_s = { part_of_motion = [0.4, 0.6] }

[vary]
stretch = 2.0
ramps = "file"
"""
SLIPPED = "th2: its motor stands -64 steps from the position that its drive reports; 0.5 is rounding"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ramps", "broken"),
    [("file", [("position", "the drive claims a position at which it is not", SLIPPED)]), ("motors", [])],
)
def test_a_stop_that_the_motors_do_not_manage_is_told(
    ramps: str, broken: list[tuple[str, str, str]], tmp_path: Path
) -> None:
    """After it the drive knows what it has counted, its motor is four full steps away, and the campaign tells it."""
    row = run_seed(campaign_of(STEEP.replace("file", ramps), tmp_path), 4)
    assert (row.ended, row.codes, row.struck) == (Ended.STOPPED, ("0x9000",), (1,))
    assert [(breach.invariant, breach.what, breach.detail) for breach in row.breaches] == broken
