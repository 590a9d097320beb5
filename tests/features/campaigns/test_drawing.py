"""Drawing runs: a seed alone makes its run again, and a campaign that grows keeps the runs that it had."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.trial import Trial, draw
from steptwin.features.campaigns.values import Draw, placed
from steptwin.host.common.errors import InputError
from tests.features.campaigns.campaigns import campaign_of
from tests.messages import refusing

WIDE = """
runs = 100
robots = ["teaching-scara", "lab-scara"]

[[motion]]
weight = 3
moves = { whole = [1, 3] }
reach = { uniform = [0.02, 0.2] }

[[motion]]
robots = ["teaching-scara"]
job = "carry"
options = { law = { choose = ["cubic", "quintic"] } }

[[scenario]]
weight = 3
name = "two"
[[scenario.fault]]
do = "protect"
joint = { any = "joint" }
held = true
at_s = { part_of_motion = [0, 1] }
[[scenario.fault]]
do = "supply"
supply_v = { uniform = [0, 40] }
at_position = { joint = { any = "joint" }, value = { on_the_way = [0.2, 0.8] } }

[[scenario]]
name = "nothing"

[vary]
payload_kg = { uniform = [0, 2] }
friction = 2
microsteps = 8
bitrate = { choose = [500000, 1000000] }
stretch = { uniform = [1, 2] }
"""


@pytest.fixture(scope="module")
def wide(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return campaign_of(WIDE, tmp_path_factory.mktemp("wide"))


@pytest.fixture(scope="module")
def trials(wide: Campaign) -> list[Trial]:
    return [draw(wide, seed) for seed in range(60)]


def _facts(trial: Trial) -> Any:
    return trial.robot_name, trial.motion_name, trial.options, trial.scenario, trial.table, trial.varied


def _planned(trial: Trial) -> Any:
    plan = trial.plan()
    return plan.points_units.tolist(), plan.times_ms.tolist(), trial.scenario_in(plan)


def test_a_seed_makes_its_run_again(wide: Campaign, trials: list[Trial]) -> None:
    for trial in trials[:6]:
        again = draw(wide, trial.seed)
        assert _facts(again) == _facts(trial)
        assert _planned(again) == _planned(trial)


def test_everything_is_drawn_by_its_weight(trials: list[Trial]) -> None:
    assert set(Counter(trial.robot_name for trial in trials)) == {"teaching-scara", "lab-scara"}
    scenarios = Counter(trial.scenario for trial in trials)
    assert scenarios["two"] > 2 * scenarios["nothing"] > 0
    assert {trial.motion_name for trial in trials if trial.robot_name == "lab-scara"} == {"random moves"}
    assert {trial.options["law"] for trial in trials if trial.motion_name == "carry"} == {"cubic", "quintic"}


def test_a_further_parameter_leaves_the_others_as_they_were(wide: Campaign, trials: list[Trial]) -> None:
    more = replace(wide, vary={"record_ms": Draw("choose", (5, 20)), **wide.vary})
    fewer = replace(wide, vary={"payload_kg": Draw("uniform", (0, 2))})
    for trial in trials[:10]:
        with_more, with_fewer = _facts(draw(more, trial.seed)), _facts(draw(fewer, trial.seed))
        assert with_more[:5] == with_fewer[:5] == _facts(trial)[:5]
        assert with_more[5] == {**trial.varied, "record_ms": with_more[5]["record_ms"]}
        assert with_fewer[5] == {"payload_kg": trial.varied["payload_kg"]}


def test_the_robot_is_as_drawn(trials: list[Trial]) -> None:
    trial = trials[0]
    robot, varied = trial.setup.robot, trial.varied
    assert robot.dynamics is not None
    assert robot.dynamics.payload_kg == varied["payload_kg"]
    assert {joint.transmission.microsteps for joint in robot.joints} == {8}
    assert robot.board.bitrate == varied["bitrate"]
    assert {joint.motor.friction_nm for joint in robot.joints if joint.motor} >= {0.02}
    slower = trial.plan().motion.duration_s / trial.motion.duration_s
    assert slower == pytest.approx(varied["stretch"], rel=0.01)


@pytest.mark.slow
def test_ramps_that_motors_manage_are_those_of_the_robot_as_drawn_wherever_they_are_named(wide: Campaign) -> None:
    """A heavier payload lowers them; nothing asks what is drawn first. By default they are the file's."""
    first = replace(wide, vary={"ramps": "motors", "payload_kg": 1.0, "friction": 2})
    last = replace(wide, vary={"friction": 2, "payload_kg": 1.0, "ramps": "motors"})
    light = replace(wide, vary={"ramps": "motors", "payload_kg": 0.1, "friction": 2})
    by_file = replace(wide, vary={"ramps": "file", "payload_kg": 1.0, "friction": 2})
    seed = next(seed for seed in range(20) if draw(wide, seed).robot_name == "lab-scara")
    shoulder = [draw(campaign, seed).setup.robot.joint("th2") for campaign in (first, last, light, by_file, wide)]
    assert shoulder[0] == shoulder[1]
    ramps = [joint.acceleration_max for joint in shoulder[1:]]
    assert ramps == [*sorted(ramps[:2]), 1500.0, 1500.0]
    assert ramps[0] < ramps[1] < 65.0
    assert draw(first, seed).plan().motion.duration_s > draw(by_file, seed).plan().motion.duration_s
    module = replace(
        light, vary={**light.vary, "driver_profile": "3a-module"}
    )  # which lowers a standing motor's current
    elbows = [draw(campaign, seed).setup.robot.joint("th3") for campaign in (light, module)]
    assert elbows[1].acceleration_max < 0.9 * elbows[0].acceleration_max


def test_random_moves_stay_within_reach(trials: list[Trial]) -> None:
    for trial in trials:
        if trial.motion_name == "random moves":
            motion, robot = trial.motion, trial.setup.robot
            way = np.abs(motion.positions(np.linspace(0, motion.duration_s, 50)) - robot.home)
            ranges = np.array([joint.upper - joint.lower for joint in robot.joints])
            assert (way <= trial.options["reach"] * ranges + 1e-9).all()


def test_instants_and_positions_are_placed_in_the_motion(trials: list[Trial]) -> None:
    trial = next(trial for trial in trials if trial.scenario == "two")
    plan = trial.plan()
    first, second = placed(dict(trial.table), plan)["fault"]
    part = trial.table["fault"][0]["at_s"].part
    assert first["at_s"] == pytest.approx(part * plan.motion.duration_s, abs=1e-4)
    at = second["at_position"]
    at_s = np.array([trial.table["fault"][1]["at_position"]["value"].part * plan.motion.duration_s])
    position = plan.motion.positions(at_s)[0, plan.robot.index_of(at["joint"])]
    assert at["value"] == pytest.approx(position, abs=1e-4)


def test_parameters_say_where_they_are(trials: list[Trial]) -> None:
    trial = next(trial for trial in trials if trial.scenario == "two" and trial.motion_name == "random moves")
    parameters = trial.parameters
    assert parameters["payload_kg"] == trial.varied["payload_kg"]
    assert parameters["random moves.reach"] == trial.options["reach"]
    assert parameters["two.fault[2].supply_v"] == trial.table["fault"][1]["supply_v"]
    assert 0 <= parameters["two.fault[1].at_s"] <= 1


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("runs = 100", "runs = 0"),
        ('"lab-scara"]', '"lab-scora"]'),
        ("moves = { whole = [1, 3] }", "move = 1"),
        ("moves = { whole = [1, 3] }", "moves = 0"),
        ("uniform = [0.02, 0.2]", "uniform = [2, 3]"),
        ('job = "carry"', 'job = "curry"'),
        ("options = { law", "options = { lew"),
        ('name = "nothing"', 'name = "two"'),
        ("payload_kg =", "payload ="),
        ("friction = 2", 'ramps = "motor"'),
        (
            "microsteps = 8",
            "microsteps = 4",
        ),
        ("[500000, 1000000]", "[400000]"),
        ("held = true", "hold = true"),
        ('robots = ["teaching-scara"]', 'robots = ["hybrid-arm"]'),
        ("weight = 3\nmoves", "weight = 0\nmoves"),
    ],
)
def test_a_wrong_campaign_is_refused(tmp_path: Path, old: str, new: str) -> None:
    assert old in WIDE
    with refusing(InputError) as refused:
        campaign_of(WIDE.replace(old, new), tmp_path)
    assert str(refused.value).startswith(f"{tmp_path / 'campaign.toml'}: ")
