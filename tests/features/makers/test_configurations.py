"""What configurations of Klipper, grbl, Marlin and LinuxCNC become: each figure by hand from its file."""

from pathlib import Path
from typing import Any

import pytest

from steptwin.features.makers.configurations.known import read_configuration
from steptwin.features.makers.robot_file import robot_of
from steptwin.host.common.errors import InputError
from steptwin.host.robots import read_robot
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.new_file import NewRobot
from tests.messages import refusing

INPUTS = Path(__file__).parent / "inputs"


def made(file: str, **settings: str) -> NewRobot:
    given = {key.replace("__", "."): text for key, text in settings.items()}
    return robot_of("mine", read_configuration(INPUTS / file), given, file)


def figures(new: NewRobot) -> dict[str, tuple[float, ...]]:
    """Return of each joint: steps per unit, lower, upper, speed and acceleration."""
    robot = read_robot(new.text)
    return {
        joint.name: (
            joint.transmission.steps_per_unit,
            joint.lower,
            joint.upper,
            joint.speed_max,
            joint.acceleration_max,
        )
        for joint in robot.joints
    }


CASES: dict[str, tuple[dict[str, str], dict[str, tuple[float, ...]]]] = {
    "klipper/bed-slinger.cfg": (
        {},
        {"X": (80, 0, 220, 250, 1500), "Y": (80, -3, 225, 250, 1500), "Z": (400, 0, 240, 6, 80)},
    ),
    "klipper/corexy-tmc.cfg": (
        {},
        {"X": (320, 0, 300, 300, 4000), "Y": (320, 0, 300, 300, 4000), "Z": (400, -4, 280, 15, 200)},
    ),
    "klipper/slow-pulses.cfg": (
        {},
        {"X": (320, 0, 600, 100, 500), "Y": (320, 0, 800, 100, 500), "Z": (320, 0, 120, 100, 500)},
    ),
    "grbl/router.txt": (
        {},
        {
            "X": (250, -400, 0, 5000 / 60, 300),
            "Y": (250, -300, 0, 5000 / 60, 300),
            "Z": (400, -80, 0, 800 / 60, 100),
        },
    ),
    "grbl/laser-with-comments.txt": (
        {"axes": "XY"},
        {"X": (80, -410, 0, 400, 900), "Y": (80, -400, 0, 400, 900)},
    ),
    "grbl/grblhal-four-axes.txt": (
        {},
        {
            "X": (200, -600, 0, 8000 / 60, 600),
            "Y": (200, -900, 0, 8000 / 60, 600),
            "Z": (1600, -110, 0, 15, 150),
            "C": (17.77778, -360, 0, 120, 720),
        },
    ),
    "marlin/plain/Configuration.h": (
        {},
        {"X": (160, 0, 210, 200, 2000), "Y": (160, -2, 204, 200, 2000), "Z": (800, 0, 180, 6, 90)},
    ),
    "marlin/corexy/Configuration.h": (
        {},
        {"X": (80, 0, 330, 300, 3000), "Y": (80, 0, 330, 300, 3000), "Z": (400, 0, 350, 12, 200)},
    ),
    "marlin/m503.txt": (
        {"X__lower": "0", "X__upper": "200", "Y__lower": "0", "Y__upper": "210", "Z__lower": "0", "Z__upper": "150"},
        {"X": (80, 0, 200, 300, 1000), "Y": (80, 0, 210, 300, 1000), "Z": (400, 0, 150, 5, 100)},
    ),
    "linuxcnc/mill.ini": (
        {},
        {"X": (400, -1, 220, 25, 300), "Y": (400, 0, 150, 25, 300), "Z": (800, -90, 0, 12, 200)},
    ),
    "linuxcnc/inch-gantry.ini": (
        {},
        {
            "X": (2000 / 25.4, 0, 609.6, 63.5, 381),
            "Y": (2000 / 25.4, 0, 914.4, 63.5, 381),
            "Z": (4000 / 25.4, -101.6, 0, 25.4, 254),
        },
    ),
    "linuxcnc/before-joints-axes.ini": ({}, {"X": (320, -50, 50, 20, 100), "Z": (640, -10, 200, 10, 100)}),
    "linuxcnc/turning-table.ini": (
        {"A__lower": "-720", "A__upper": "720"},
        {
            "X": (160, 0, 300, 30, 200),
            "Y": (160, 0, 300, 30, 200),
            "Z": (400, -60, 0, 10, 100),
            "C": (80, -720, 720, 90, 360),
        },
    ),
}


@pytest.mark.parametrize("file", CASES)
def test_each_figure_is_the_files(file: str) -> None:
    settings, expected = CASES[file]
    found = figures(made(file, **settings))
    assert list(found) == list(expected)
    for name, figures_expected in expected.items():
        assert found[name] == pytest.approx(figures_expected, rel=1e-12), name


@pytest.mark.parametrize(
    ("file", "settings"),
    [
        ("klipper/belt-printer.cfg", {}),
        ("klipper/delta.cfg", {}),
        ("klipper/drivers.cfg", {}),
        ("grbl/laser-with-comments.txt", {}),
        ("grbl/erased.txt", {}),
        ("grbl/before-0-9.txt", {}),
        ("grbl/router.txt", {"X__pitch": "8"}),
        ("grbl/router.txt", {"A__lower": "0"}),
        ("grbl/router.txt", {"axes": "XA"}),
        ("grbl/router.txt", {"belts": "crossed"}),
        ("grbl/router.txt", {"driver_profile": "a4899"}),
        ("grbl/router.txt", {"X__travel_per_turn": "7.3"}),
        ("grbl/router.txt", {"X__travel_per_turn": "0"}),
        ("grbl/router.txt", {"X__upper": "far"}),
        ("grbl/router.txt", {"X__travel_per_turn": "abc"}),
        ("grbl/router.txt", {"X__motor": "17HS"}),
        ("grbl/router.txt", {"X__mass_kg": "-0.1"}),
        ("grbl/router.txt", {"supply_v": "0"}),
        ("marlin/m503.txt", {}),
        ("marlin/delta/Configuration.h", {}),
        ("marlin/odd/Configuration.h", {}),
        ("linuxcnc/delta.ini", {}),
        ("linuxcnc/turning-table.ini", {}),
    ],
)
def test_what_is_refused(file: str, settings: dict[str, str]) -> None:
    with refusing(InputError):
        made(file, **settings)


def test_a_belt_printer_with_an_end_is_a_machine() -> None:
    assert figures(made("klipper/belt-printer.cfg", Z__upper="1500"))["Z"][2] == 1500


def test_only_grblhal_has_a_jerk() -> None:
    assert [joint.jerk_max for joint in read_robot(made("grbl/grblhal-four-axes.txt").text).joints] == [
        6000,
        None,
        1500,
        None,
    ]
    assert "jerk_max" not in made("grbl/router.txt").text


def test_both_belts_move_both_slides() -> None:
    """A Z with two motors has two rows."""
    belts = ((1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert read_robot(made("klipper/belt-printer.cfg", Z__upper="1500").text).coupling.matrix == belts
    assert read_robot(made("grbl/router.txt", belts="corexy").text).coupling.matrix == belts
    assert read_robot(made("klipper/corexy-tmc.cfg").text).coupling.matrix[:3] == belts
    assert read_robot(made("grbl/router.txt").text).coupling.matrix == ()


@pytest.mark.parametrize(
    ("file", "board"),
    [
        ("klipper/bed-slinger.cfg", {"driver_profile": "a4988", "steplen_ns": 4000, "stepspace_ns": 4000}),
        ("klipper/corexy-tmc.cfg", {"driver_profile": "tmc2209", "steplen_ns": 4000, "current_a": 0.919}),
        ("klipper/slow-pulses.cfg", {"steplen_ns": 6000, "stepspace_ns": 6000, "step_rate_max_hz": 83_333}),
        ("grbl/router.txt", {"steplen_ns": 10_000}),
        ("marlin/plain/Configuration.h", {"driver_profile": "drv8825", "steplen_ns": 4000}),
        ("marlin/corexy/Configuration.h", {"driver_profile": "tmc2209", "steplen_ns": 4000, "dirsetup_ns": 500}),
        ("linuxcnc/mill.ini", {"steplen_ns": 6000, "stepspace_ns": 5000, "dirsetup_ns": 20_000, "dirhold_ns": 20_000}),
        ("linuxcnc/inch-gantry.ini", {"steplen_ns": 4000, "stepspace_ns": 4000}),
    ],
)
def test_the_controllers_pulses(file: str, board: dict[str, Any]) -> None:
    """The longest of what the controller makes, the driver needs and our firmware can make, which is 4 us."""
    found = read_robot(made(file).text).board
    assert {key: getattr(found, key) for key in board} == board


def test_homing() -> None:
    """Klipper infers the direction by the nearest end; grbl has it in a mask; LinuxCNC in the sign of the speed."""
    homed = {
        file: {
            joint.name: (homing.method, homing.search_speed, homing.zero_speed)
            for joint in read_robot(made(file).text).joints
            if (homing := joint.homing)
        }
        for file in ("klipper/slow-pulses.cfg", "klipper/corexy-tmc.cfg", "grbl/router.txt", "linuxcnc/mill.ini")
    }
    assert homed["klipper/slow-pulses.cfg"]["X"] == (17, 5.0, 2.5)
    assert homed["klipper/slow-pulses.cfg"]["Y"] == (18, 5.0, 2.5)
    assert homed["klipper/corexy-tmc.cfg"]["X"][0] == 35
    assert homed["klipper/corexy-tmc.cfg"]["Y"] == (18, 80.0, 8.0)
    assert homed["grbl/router.txt"]["X"] == pytest.approx((17, 25.0, 50 / 60))
    assert homed["grbl/router.txt"]["Z"][0] == 18
    assert homed["linuxcnc/mill.ini"]["X"] == (17, 10.0, 1.0)
    assert homed["linuxcnc/mill.ini"]["Y"] == (18, 10.0, 1.0)
    assert homed["linuxcnc/mill.ini"]["Z"][0] == 35


@pytest.mark.parametrize(
    ("settings", "microsteps", "turn"),
    [
        ({}, 16, 12.8),
        ({"X__microsteps": "8"}, 8, 6.4),
        ({"X__travel_per_turn": "6.4"}, 8, 6.4),
        ({"X__microsteps": "8", "X__full_steps_per_rev": "400"}, 8, 12.8),
    ],
)
def test_microsteps_and_travel_share_the_steps(settings: dict[str, str], microsteps: int, turn: float) -> None:
    """250 steps per mm is all that grbl knows."""
    new = made("grbl/router.txt", **settings)
    transmission = read_robot(new.text).joints[0].transmission
    assert transmission.microsteps == microsteps
    assert transmission.travel_per_turn == pytest.approx(turn)
    asked = [note for note in new.notes if note.startswith("fill in: X: 250 steps per mm are sure")]
    assert bool(asked) == (not settings)


@pytest.mark.parametrize(
    ("file", "note"),
    [
        ("klipper/corexy-tmc.cfg", "not found beside the file, and not read: toolhead/*.cfg"),
        ("klipper/corexy-tmc.cfg", "X: endstop_pin tmc2209_stepper_x:virtual_endstop is no switch: homing is left out"),
        ("klipper/corexy-tmc.cfg", "Y: STEP makes a step at each edge, up and down"),
        ("klipper/bed-slinger.cfg", "not read: [extruder], [fan]"),
        (
            "klipper/slow-pulses.cfg",
            "[input_shaper] is not read: switch it off for a capture; [shaping] shapes motions here (docs/motions.md)",
        ),
        ("klipper/slow-pulses.cfg", "Z: the switch at 1.25"),
        ("grbl/laser-with-comments.txt", "$130 stands several times: the last one holds"),
        ("grbl/laser-with-comments.txt", "$1=25: the motors lose their current at each standstill"),
        ("grbl/laser-with-comments.txt", "X: 32000 steps/s is more than the 30 000 of grbl on an AVR"),
        ("grbl/router.txt", "whether it is a CoreXY is compiled into grbl"),
        ("marlin/plain/Configuration.h", "Configuration_adv.h is not beside the file"),
        ("marlin/plain/Configuration.h", "CLASSIC_JERK is a jump of the speed at corners"),
        ("marlin/plain/Configuration.h", "moves have at most 1200 mm/s2 on the machine"),
        ("linuxcnc/mill.ini", "SCALE is negative in JOINT_1"),
        ("linuxcnc/mill.ini", "BACKLASH is not read"),
        ("linuxcnc/inch-gantry.ini", "lengths of the file are in inches"),
        ("linuxcnc/inch-gantry.ini", "Y: joint 2 moves it too: a second motor"),
    ],
)
def test_what_is_told(file: str, note: str) -> None:
    assert any(each.startswith(note) for each in made(file, **(CASES[file][0] if file in CASES else {})).notes)


def test_a_driver_that_needs_longer_pulses_is_told() -> None:
    new = made("klipper/bed-slinger.cfg", driver_profile="chip-330pf")
    assert any(
        note.startswith("steplen_ns: chip-330pf needs 30000 ns, the controller makes 2000 ns") for note in new.notes
    )
    assert read_robot(new.text).board.steplen_ns >= 30_000


def test_second_motors_and_units() -> None:
    robot = read_robot(made("linuxcnc/inch-gantry.ini").text)
    assert [joint.second_motor is not None for joint in robot.joints] == [False, True, False]
    table = read_robot(made("linuxcnc/turning-table.ini", A__lower="0", A__upper="360").text)
    assert [joint.unit for joint in table.joints] == [Unit.MM, Unit.MM, Unit.MM, Unit.DEG]
