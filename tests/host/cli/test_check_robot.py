"""`steptwin check my-arm.toml`: everything that is wrong in a robot file, or what it amounts to."""

import re
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.robots import brought_text, read_robot
from steptwin.host.robots.new_file import robot_text, with_settings
from tests.end_to_end.command_line import run_json
from tests.host.robots.coupled import coupled_text

TEXT = brought_text("teaching-scara")

WRONG = {
    "travel_per_turn = 5.0": "travel_per_trun = 5.0",
    "l2_mm = 100.0": "l2_mm = '100'",
    "osc_pf = 330": "osc_pf = 12",
    "steplen_ns =": "bitrate = 999\nsteplen_ns =",
    "microsteps = 16": "microsteps = 3",
    "ratio = 4.0": "",
    "th4 = 0.0 #": "th5 = 0.0 #",
    'joint = "th4", out = 1': 'joint = "th4", out = 9',
}
"""Mistakes in as many tables; each replaces the first occurrence."""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    return tmp_path / "my-arm.toml"


def test_all_mistakes_are_named_at_once(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = TEXT
    for old, new in WRONG.items():
        assert old in text
        text = text.replace(old, new, 1)
    arm.write_text(text, encoding="utf-8")
    messages = run_json(capsys, "check", str(arm), exit_code=2)["findings"]
    for words in (
        "joints.d3.travel_per_trun: key 'travel_per_trun' is unknown: did you mean travel_per_turn?",
        "kinematics.l2_mm: '100' is not a number",
        "board.osc_pf: 12 pF makes the TB6560's oscillator faster",
        "board.bitrate: 999 is not one of",
        "joints.th1.ratio: is missing",
        "home.th5: key 'th5' is unknown: did you mean th4",
        "outputs.gripper.out: 9 is not from 1",
        "joints.th1.microsteps: 3 is not one of the drivers'",
    ):
        assert len([message for message in messages if words in message]) == 1, (words, messages)
    assert len(messages) == len(WRONG)


MISTAKES = {
    "[joints.d3]": "[joints.lift]",
    "l1_mm = 95.0": "l1_mm = 0.0",
    "l2_mm = 100.0": "",
    "osc_pf = 330": "osc_pf = '330'",
    "step_rate_max_hz = 15_000": "step_rate_max_hz = 16_000",
    "lower = -360.0": "lower = 361.0",
    "upper = 150.0": "uper = 150.0",
    "microsteps = 16": "microsteps = 3",
    "ratio = 4.0": "gear = 4.0",
    "negative_limit = -135.0": "negative_limit = -100.0",
    "search_speed = 45.0": "search_speed = 500.0",
    "method = 17": "method = 1",
    'joint = "th4", out = 1': 'joint = "th5", out = 9',
    "th1 = 0.0": "th1 = -131.0",
    "[home]": "[coupling.th5]\nth9 = 1.0\n[home]",
}
"""Mistakes of which none is about a value that another one needs."""


def findings_of(changes: Mapping[str, str]) -> list[str]:
    text = TEXT
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new, 1)
    with pytest.raises(InputError) as caught:
        read_robot(text)
    return sorted(caught.value.messages)


@pytest.mark.slow
def test_no_mistake_hides_another() -> None:
    """Any two mistakes are found as each is alone: nothing more, and nothing less."""
    alone = {old: findings_of({old: new}) for old, new in MISTAKES.items()}
    for pair in combinations(MISTAKES, 2):
        both = findings_of({old: MISTAKES[old] for old in pair})
        expected = sorted(alone[pair[0]] + alone[pair[1]])
        assert both == expected, pair


def test_a_renamed_joint_is_said_to_be_missing() -> None:
    """The tables [joints.d3.switches] and [joints.d3.homing] stay, home and outputs name d3: no complaint of these."""
    names = "the joints of this 'teaching-scara' are th1 th2 d3 th4"
    strange = "joints.lift: this 'teaching-scara' has no such joint: did you mean d3?"
    expected = [f"joints.d3: is missing: {names}", strange]
    assert findings_of({"[joints.d3]": "[joints.lift]"}) == expected
    everywhere = TEXT.replace("joints.d3", "joints.lift").replace("\nd3 = ", "\nlift = ")
    with pytest.raises(InputError) as caught:
        read_robot(everywhere)
    assert sorted(caught.value.messages) == expected


def test_the_key_that_is_meant_is_not_called_missing(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text(TEXT.replace("travel_per_turn", "travel_per_rev"), encoding="utf-8")
    assert run(["check", str(arm)]) == 2
    line = f"{arm}: joints.d3.travel_per_rev: key 'travel_per_rev' is unknown: did you mean travel_per_turn?\n"
    assert capsys.readouterr().err == line


def test_mistakes_of_several_joints_beside_impossible_dimensions(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = TEXT.replace("speed_max = 180.0", "speed_max = 999.0").replace("l1_mm = 95.0", "l1_mm = 0.0")
    arm.write_text(text, encoding="utf-8")
    assert run_json(capsys, "check", str(arm), exit_code=2)["findings"] == [
        "kinematics.l1_mm: 0 is not above 0",
        "joints.th1.speed_max: 999 deg/s takes 35.5 kHz of steps, more than the driver's 15.0 kHz;"
        " speed_max = 421.875 or microsteps = 2 would do",
        "joints.th2.speed_max: 999 deg/s takes 35.5 kHz of steps, more than the driver's 15.0 kHz;"
        " speed_max = 421.875 or microsteps = 2 would do",
    ]


def test_a_right_file_says_what_it_amounts_to(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """5 mm of lead at 1/8 step are 320 steps/mm; stretched to folded at 150 deg the arm of 95 + 100 mm reaches
    195 to sqrt(95^2 + 100^2 - 2 * 95 * 100 cos 30) = 50.70 mm.
    """
    arm.write_text(TEXT, encoding="utf-8")
    document = run_json(capsys, "check", str(arm))
    assert (document["kind"], document["findings"], document["robot"]) == ("robot", [], "teaching-scara")
    lift = next(joint for joint in document["joints"] if joint["name"] == "d3")
    assert (lift["lower"], lift["upper"], lift["unit"], lift["steps_per_unit"]) == (0, 60, "mm", 320)
    assert (lift["speed_max"], lift["step_rate_max_hz"], lift["homing_method"]) == (40, 12800, 17)
    assert lift["step_rate_percent"] == pytest.approx(85.333, abs=1e-3)
    assert document["reach"]["radius_mm"] == pytest.approx([50.7003, 195.0], abs=1e-3)
    assert document["reach"]["z_mm"] == pytest.approx([-100, -40])
    assert run(["check", str(arm)]) == 0
    out = capsys.readouterr().out
    assert "the tool reaches r = 50.7..195.0 mm at z = -40 mm, an area of " in out
    assert f"{document['reach']['area_mm2'] / 100:.0f} cm2; z = -100.0..-40.0 mm" in out


@pytest.mark.slow
def test_coupled_axes_have_their_equations(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text(coupled_text("th2 = { th1 = 1.0 }\nd3 = { th4 = -0.05 }"), encoding="utf-8")
    assert run_json(capsys, "check", str(arm))["coupling"] == ["axis th2 = th2 + th1", "axis d3 = d3 - 0.05 th4"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "asked"),
    [
        ({"l1_mm = 95.0": "l1_mm = 0.095", "l2_mm = 100.0": "l2_mm = 0.1"}, "kinematics: the tool reaches no further"),
        ({"lower = -130.0": "lower = -2.1", "upper = 130.0": "upper = 2.1"}, "joints.th1: its range is 4.2 deg: "),
    ],
)
def test_units_in_doubt_are_asked_for(
    changed: Mapping[str, str], asked: str, arm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = TEXT
    for old, new in changed.items():
        assert old in text
        text = text.replace(old, new, 1)
    arm.write_text(text, encoding="utf-8")
    assert run(["check", str(arm)]) == 0
    warning, *others = capsys.readouterr().err.splitlines()
    assert warning.startswith(f"steptwin: warning: {asked}")
    assert others, "the arm misses its spots, too"
    assert all(re.match(r"steptwin: warning: shelf\.spots\.q[ab]: carry brings", other) for other in others)


@pytest.mark.parametrize(
    ("driver", "told"),
    [
        ("a4988", None),
        ("drv8825", None),
        ("tmc2209", None),
        ("3a-module", None),
        ("dm542t", "takes 3.5 V or more at STEP, DIR and ENABLE as high, and the board's pins have 3.3 V: put buffers"),
        ("dm542", "takes 5 V or more at STEP, DIR and ENABLE as high, and the board's pins have 3.3 V: put buffers"),
    ],
)
def test_inputs_that_the_boards_pins_do_not_reach(
    driver: str, told: str | None, arm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = TEXT.replace("osc_pf = 330", f'driver_profile = "{driver}"\n#', 1)
    arm.write_text(text.replace("dirsetup_ns = ", "dirsetup_ns = 9", 1), encoding="utf-8")
    assert run(["check", str(arm)]) == 0
    found = [line for line in capsys.readouterr().err.splitlines() if "driver_profile" in line]
    if told is None:
        assert found == []
    else:
        assert len(found) == 1
        assert found[0].startswith(f"steptwin: warning: board.driver_profile: {driver} {told}")


@pytest.mark.parametrize(
    ("high_v", "light_ma", "told"),
    [
        (3.3, 8.0, None),
        (3.31, 8.0, "3.31 V or more at STEP, DIR and ENABLE as high, and the board's pins have 3.3 V: put"),
        (3.3, 8.1, "8.1 mA at STEP, DIR and ENABLE, and the board's pins have 8 mA: put"),
        (5.0, 10.0, "5 V or more at STEP, DIR and ENABLE as high and 10 mA, and the board's pins have 3.3 V and 8 mA"),
    ],
)
def test_levels_and_currents_of_a_driver_of_ones_own(
    high_v: float, light_ma: float, told: str | None, arm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times = "".join(f"{name}_ns = 5000\n" for name in ("steplen", "stepspace", "dirsetup", "dirhold"))
    figures = f"[board.driver]\nmicrosteps = [8, 16]\n{times}input_high_v = {high_v}\ninput_ma = {light_ma}\n"
    text = TEXT.replace("osc_pf = 330", 'driver_profile = "generic"', 1).replace("[joints", f"{figures}\n[joints", 1)
    arm.write_text(text, encoding="utf-8")
    assert run(["check", str(arm)]) == 0
    found = [line for line in capsys.readouterr().err.splitlines() if "driver_profile" in line]
    assert len(found) == (told is not None)
    assert told is None or found[0].startswith(f"steptwin: warning: board.driver_profile: generic takes {told}")


def test_a_robot_file_needs_no_robot(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text(TEXT, encoding="utf-8")
    assert run(["check", str(arm), "lab-scara"]) == 2
    assert capsys.readouterr().err == f"{arm}: is a robot itself: leave lab-scara out\n"


def test_a_file_of_no_kind(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text("name = 'x'\n", encoding="utf-8")
    assert run(["check", str(arm)]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"steptwin: {arm}: has none of step, steps, sequences, ")
    assert ", kinematics, joints, board: it is no program and " in told
    assert told.endswith(" and no robot\n")


@pytest.mark.parametrize(
    ("joints", "task", "told"),
    [
        pytest.param(6, "pose", None, marks=pytest.mark.slow),
        (
            5,
            "pose",
            'a pose has 6 coordinates, but 5 joints move the tool: most are out of reach; task = "direction" suits',
        ),
        (
            4,
            "pose",
            'a pose has 6 coordinates, but 3 joints move the tool: most are out of reach; task = "position" suits',
        ),
        (5, "direction", None),
        (3, "position", None),
        (
            2,
            "position",
            "a position has 3 coordinates, but 2 joints move the tool: most are out of reach; programs move",
        ),
    ],
)
def test_a_task_of_more_coordinates_than_joints_is_told(
    joints: int, task: str, told: str | None, arm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = robot_text("arm", "chain", *with_settings("chain", {"joints": str(joints)}))
    arm.write_text(re.sub(r'^task = "\w+"', f'task = "{task}"', text, flags=re.MULTILINE), encoding="utf-8")
    assert run(["check", str(arm)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == (told is not None)
    assert told is None or lines[0].startswith(f"steptwin: warning: kinematics.task: {told}")
