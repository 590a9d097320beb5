"""Write the file of a new robot: its kind, dimensions and transmissions, the rest with sensible defaults.

Speeds follow from the step rate that the driver takes, switches and homing from the ranges. The kinds of the robots
that StepTwin brings begin with these robots' values.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from steptwin.host.common.bad_input import prefixed, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.common.numbers import digits_in, finite_number
from steptwin.host.robots import load_robot, read_robot, robot_names
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.bare_axes import AxesGeometry
from steptwin.host.robots.kinematics.base import dimensions, geometry_of, meaning
from steptwin.host.robots.kinematics.cartesian import CartesianGeometry
from steptwin.host.robots.kinematics.kinds import kind_named
from steptwin.host.robots.kinematics.serial.chain_geometry import JOINTS_MAX, ChainGeometry, usual_arm
from steptwin.host.robots.kinematics.usual_scara import ScaraGeometry
from steptwin.host.robots.new_joint import (
    BOARD,
    FULL_STEPS_PER_REV,
    USUAL_DRIVERS,
    NewJoint,
    board_with,
    read_joint,
)
from steptwin.host.robots.new_motors import SUPPLY, NewMotors, supply_voltage
from steptwin.host.robots.robot import Dimension, Robot
from steptwin.host.robots.toml_text import toml_lines, toml_value

_BOARD_NOTES: Final = {
    "bitrate": "bit/s of the CAN bus",
    "osc_pf": "pF at the TB6560's OSC pin: no CLK pulse below 30 us",
    "steplen_ns": "CLK high: 10 % above those 30 us",
    "stepspace_ns": "CLK low: both together are 15 kHz",
    "dirsetup_ns": "DIR stable before CLK rises",
    "dirhold_ns": "DIR stable after CLK has risen",
    "step_rate_max_hz": "the TB6560's limit",
}

_CHAIN_JOINTS: Final = (
    NewJoint("", Unit.DEG, "waist", -170.0, 170.0, 40.0, 8),
    NewJoint("", Unit.DEG, "shoulder", -40.0, 90.0, 50.0, 8),
    NewJoint("", Unit.DEG, "elbow", -90.0, 50.0, 50.0, 8),
    NewJoint("", Unit.DEG, "forearm", -180.0, 180.0, 40.0, 8),
    NewJoint("", Unit.DEG, "wrist", -105.0, 105.0, 20.0, 8, home=45.0),
    NewJoint("", Unit.DEG, "tool", -180.0, 180.0, 20.0, 8),
)
"""The joints of a six-axis arm of the usual shape."""
_GANTRY_JOINTS: Final = {
    "X": NewJoint("X", Unit.MM, "slide along x, belt", 0.0, 300.0, 40.0, 16),
    "Y": NewJoint("Y", Unit.MM, "slide along y, belt", 0.0, 300.0, 40.0, 16),
    "Z": NewJoint("Z", Unit.MM, "slide along z, screw", 0.0, 100.0, 8.0, 8),
    "C": NewJoint("C", Unit.DEG, "tool, belt", -180.0, 180.0, 3.0, 16),
}
_TURNTABLE: Final = NewJoint("table", Unit.DEG, "turntable, belt", -720.0, 720.0, 6.0, 16)

_SCARA_JOINTS: Final = {
    "lift": NewJoint("", Unit.MM, "lift, screw", 0.0, 80.0, 4.0, 8),
    "shoulder": NewJoint("", Unit.DEG, "shoulder, belt", -130.0, 130.0, 4.0, 16),
    "elbow": NewJoint("", Unit.DEG, "elbow, belt", -150.0, 150.0, 4.0, 16, home=60.0),
    "tool": NewJoint("", Unit.DEG, "tool, belt", -180.0, 180.0, 2.0, 16),
}

_BELTS, _EACH, _COREXY = "belts", "each", "corexy"
"""What a new gantry's file is asked beside its dimensions: whether it needs a coupling."""

DRIVER_PROFILE: Final = "driver_profile"
_JOINTS_COUNT: Final = "joints"
"""What every new file may be asked beside its dimensions, and one whose kind has a free number of joints."""
_COUNTS: Final = {"axes": (1, JOINTS_MAX), "chain": (len(_CHAIN_JOINTS), len(_CHAIN_JOINTS))}
"""Of each kind with a free number of joints the usual number and the most of a new file."""

_COMMENT: Final = re.compile(r"^\[joints\.(\S+)\] # (.+)$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class NewRobot:
    """A robot file that was made of another file.

    Attributes:
        text: the text of the file.
        kind: its kind.
        geometry: the keys of its [kinematics].
        joints: the names of its joints.
        notes: what its user should know, a line each.
    """

    text: str
    kind: str
    geometry: Mapping[str, Dimension]
    joints: tuple[str, ...]
    notes: tuple[str, ...]


def usual_dimensions(kind: str, joints: int | None = None) -> dict[str, Dimension]:
    """Return the dimensions with which a new robot of a kind begins; raise InputError for an unknown kind.

    `joints` is their number, where it is free; by default the usual one.
    """
    usual = {name: field.metadata["usual"] for name, field in dimensions(kind_named(kind).geometry).items()}
    if kind == "chain" and joints is not None:
        usual |= usual_arm(joints)
    return {name: deepcopy(value) for name, value in usual.items() if value not in (None, ())}


def _joint_count(kind: str, settings: Mapping[str, str]) -> int | None:
    """Return how many joints a new robot gets by its settings, or usually; None where the kind has a fixed number."""
    if kind not in _COUNTS:
        return None
    usual, most = _COUNTS[kind]
    text = settings.get(_JOINTS_COUNT, str(usual))
    count = digits_in(text)
    if count is None or not 1 <= count <= most:
        raise InputError(
            f"{_JOINTS_COUNT}: {shortened(text)!r} is not one of {', '.join(map(str, range(1, most + 1)))}"
        )
    return count


def questions_of(kind: str, settings: Mapping[str, str]) -> dict[str, tuple[str, Dimension]]:
    """Return the questions of a new file beside those of its joints: the meaning and the usual value, by key.

    Raises:
        InputError: an unknown kind, or the settings have a number of joints that it cannot have.
    """
    meanings = {key: meaning(field) for key, field in dimensions(kind_named(kind).geometry).items()}
    joints = _joint_count(kind, settings)
    questions: dict[str, tuple[str, Dimension]] = {}
    if joints is not None:
        questions[_JOINTS_COUNT] = (f"number of joints, 1 to {_COUNTS[kind][1]}", joints)
    for key, value in usual_dimensions(kind, joints).items():
        if isinstance(value, dict):
            rows = {name: each for name, each in value.items() if isinstance(each, dict)}
            questions |= {f"{name}.{part}": (meanings[key], each[part]) for name, each in rows.items() for part in each}
        elif not isinstance(value, list):
            questions[key] = (meanings[key], value)
    if kind == "cartesian":
        questions[_BELTS] = (f"{_COREXY} if two belts move X and Y together, else {_EACH}", _EACH)
    questions[DRIVER_PROFILE] = ("drivers, such as a4988 (docs/driver.md)", USUAL_DRIVERS)
    return questions


def usual_joints(kind: str, geometry: Mapping[str, Dimension], joints: int | None = None) -> list[NewJoint]:
    """Return the joints with which a new robot begins; raise InputError if the dimensions do not fit the kind.

    `joints` is the number of those that no dimension names.
    """
    made = geometry_of(kind_named(kind).geometry, geometry)
    if isinstance(made, AxesGeometry):
        if joints in (None, 1):
            return [_TURNTABLE]
        return [replace(_TURNTABLE, name=f"axis{number}") for number in range(1, joints + 1)]
    if isinstance(made, CartesianGeometry):
        return [_GANTRY_JOINTS[letter] for letter in made.axes]
    if isinstance(made, ChainGeometry):
        return [replace(usual, name=name) for name, usual in zip(made.joints, _CHAIN_JOINTS, strict=False)]
    if not isinstance(made, ScaraGeometry):
        return _joints_of(load_robot(kind))
    rotary = iter(("shoulder", "elbow", "tool"))
    roles = ["lift" if unit is Unit.MM else next(rotary) for unit in made.joints.values()]
    return [replace(_SCARA_JOINTS[role], name=name) for name, role in zip(made.joints, roles, strict=True)]


def with_settings(kind: str, settings: Mapping[str, str]) -> tuple[dict[str, Dimension], list[NewJoint]]:
    """Return dimensions and joints with some values set: `l1_mm` and the like, `d3.upper` and the like, as texts.

    Raises:
        InputError: with a message for every setting that is unknown or not a value.
    """
    questions, count, findings = questions_of(kind, settings), _joint_count(kind, settings), Findings()
    geometry, board = usual_dimensions(kind, count), BOARD
    for key in [key for key in settings if "." not in key or key in questions]:
        with findings.collecting():
            if key not in questions and key != SUPPLY:
                raise _unknown_setting(kind, key, questions, count)
            if key == _JOINTS_COUNT:
                continue
            if key == DRIVER_PROFILE:
                with prefixed(f"{key}: "):
                    board = board_with(settings[key])
                continue
            if key == SUPPLY:
                with prefixed(f"{key}: "):
                    geometry[SUPPLY] = supply_voltage(settings[key])
                continue
            _set(geometry, key, read_dimension(key, settings[key], questions[key][1]))
    findings.raise_first()
    own = _own(geometry)
    joints = {joint.name: joint.on(board) for joint in usual_joints(kind, own, count)}
    for key in [key for key in settings if "." in key and key not in questions]:
        with findings.collecting():
            name, _, quantity = key.partition(".")
            if name not in joints:
                raise unknown("joint", name, joints)
            joints[name] = read_joint(joints[name], quantity, settings[key])
    findings.raise_first()
    return geometry, list(joints.values())


def _set(geometry: dict[str, Dimension], key: str, value: Dimension) -> None:
    """Set a dimension, or one in the table of a joint."""
    name, _, part = key.partition(".")
    if part:
        next(table for table in geometry.values() if isinstance(table, dict) and name in table)[name][part] = value
    else:
        geometry[key] = value


def _unknown_setting(kind: str, key: str, questions: Iterable[str], count: int | None) -> InputError:
    """Return the error for a key without a joint that is no dimension; one of a joint's values names its joints."""
    joints = usual_joints(kind, usual_dimensions(kind, count), count)
    of_joints = [f"{joint.name}.{key}" for joint in joints if key in joint.settings]
    if of_joints:
        return InputError(f"{key!r} is a joint's value: write {' or '.join(of_joints)}")
    return unknown("dimension", key, questions)


def read_dimension(key: str, text: str, usual: Dimension) -> Dimension:
    """Return a dimension from its text, of the same type as the usual value."""
    if isinstance(usual, bool):
        if text not in ("true", "false"):
            raise InputError(f"{key}: {text!r} is neither true nor false")
        return text == "true"
    if isinstance(usual, StrEnum):
        choices = list(type(usual))
        if text not in choices:
            raise InputError(f"{key}: {text!r} is not one of {', '.join(choices)}")
        return text
    if isinstance(usual, str):
        return text
    with prefixed(f"{key}: "):
        return finite_number(text)


def _own(geometry: Mapping[str, Dimension]) -> dict[str, Dimension]:
    """Return the dimensions of the mechanism, without what else the file is told."""
    return {key: value for key, value in geometry.items() if key not in (_BELTS, SUPPLY)}


def new_motors(geometry: Mapping[str, Dimension], joints: Sequence[NewJoint]) -> NewMotors:
    """Return what is said of the motors of a new robot."""
    supply_v = geometry.get(SUPPLY)
    return NewMotors(
        {joint.name: joint.motor for joint in joints if joint.motor is not None},
        {joint.name: joint.mass_kg for joint in joints if joint.mass_kg is not None},
        None if supply_v is None else float(supply_v),
    )


def robot_text(name: str, kind: str, geometry: Mapping[str, Dimension], joints: list[NewJoint]) -> str:
    """Return the text of a robot file; raise InputError, with everything that is wrong, if it would be no robot."""
    meanings = {key: meaning(field) for key, field in dimensions(kind_named(kind).geometry).items()}
    coupled = ("X", "Y") if geometry.get(_BELTS) == _COREXY else ()
    parts = [
        _HEAD.format(kind=kind, summary=kind_named(kind).summary),
        toml_lines({"name": name, "title": f"{name}, a robot of the kind {kind}"}, {}),
        _kinematics_text(kind, _own(geometry), meanings),
        _BASE,
        *([_coupling_text(geometry)] if kind == "cartesian" else []),
        _board_text(joints[0].board),
        _JOINTS + (_SLIDES if kind == "axes" else ""),
        *(_joint_text(joint, is_coupled=joint.name in coupled) for joint in joints),
        "[home] # where the arm is taken after homing\n"
        + toml_lines({joint.name: min(max(joint.home, joint.lower), joint.upper) for joint in joints}, {}),
        _devices(kind, joints),
        new_motors(geometry, joints).text({joint.name: joint.unit for joint in joints}),
    ]
    text = "\n".join(parts)
    read_robot(text)
    return text


def _coupling_text(geometry: Mapping[str, Dimension]) -> str:
    """Return the table of a CoreXY's belts, as a comment unless the machine is one; InputError if it cannot be."""
    belts = geometry.get(_BELTS, _EACH)
    if belts not in (_EACH, _COREXY):
        raise InputError(f"{_BELTS}: {belts!r} is neither {_EACH} nor {_COREXY}")
    if belts == _EACH:
        return _comment(_COUPLING)
    if not {"X", "Y"} <= set(geometry["axes"]):
        raise InputError(f"{_BELTS}: {_COREXY} moves X and Y, but axes is {geometry['axes']!r}")
    return _COUPLING


def _kinematics_text(kind: str, geometry: Mapping[str, Dimension], meanings: Mapping[str, str]) -> str:
    """Return the table of the mechanism; a dimension that is a table has a line for each of its entries."""
    flat = {key: value for key, value in geometry.items() if not isinstance(value, dict)}
    parts = ["[kinematics] # docs/robot-files.md has a drawing\n" + toml_lines({"kind": kind, **flat}, meanings)]
    for key, table in geometry.items():
        if isinstance(table, dict):
            rows = (f"{name} = {toml_value(each)}\n" for name, each in table.items())
            parts.append(f"[kinematics.{key}] # {meanings[key]}\n{''.join(rows)}")
    return "\n".join(parts)


_HEAD: Final = """\
# A robot of the kind {kind}: {summary}.
#
# `steptwin check` reads this file and says everything that is wrong. Lengths are in mm, angles in degrees. In poses of
# the tool x and y are horizontal and z is upwards: a tool below the height 0 is at a negative z.
"""
_BASE: Final = """\
# [base] # where the base stands in the station, and how far it is turned: poses of the tool are in the station's frame
# x_mm = 0.0
# y_mm = 0.0
# z_mm = 0.0
# phi_deg = 0.0
"""
_COUPLING: Final = """\
[coupling] # for CoreXY and H-bot: two motors move both slides; rows are axes, columns joints (docs/robot-files.md)
X = { X = 1.0, Y = 1.0 }
Y = { X = -1.0, Y = 1.0 }
"""
_DRIVERS: Final = """\
# For drivers other than TB6560s on the board: driver_profile = "a4988" or another of docs/driver.md in place of osc_pf
# and all times, which then are those of the drivers. Any driver without a profile is "generic", by its manual's times.
"""
_OTHER_DRIVERS: Final = """\
# docs/driver.md has all drivers. Any without a profile is "generic", by its manual's times.
"""
_SLIDES: Final = """\
# A joint that slides has unit = "mm", and travel_per_turn, in mm, in place of ratio.
"""
_JOINTS: Final = """\
# Joints in the order of their axes on the board. speed_max was derived from transmission and microsteps when this file
# was written: 80 % of the driver's step rate, at most 8 turns of the motor and 180 degrees a second. acceleration_max
# reaches it in 0.2 s. Neither knows your motors and masses: the end of this file has lines for them.
"""
_OUTPUTS: Final = """\
# [outputs] # digital outputs of the board: the joint whose axis has it, and its number there
# gripper = {{ joint = "{joint}", out = 1 }}

# [inputs] # digital inputs, likewise: programs wait for them
# part_ready = {{ joint = "{joint}", input = 1 }}
"""


_TURN_NOTES: Final = {
    Unit.MM: "mm per turn: a screw's lead, or a pulley's circumference",
    Unit.DEG: "motor turns per turn of the joint",
}


def _board_text(board: BoardSettings) -> str:
    """Return the table of the board: of drivers with a profile its name, whose times the reader takes."""
    if board.driver_profile is None:
        return _DRIVERS + "[board]\n" + toml_lines({key: getattr(board, key) for key in _BOARD_NOTES}, _BOARD_NOTES)
    notes = {"bitrate": _BOARD_NOTES["bitrate"], DRIVER_PROFILE: f"{board.profile.title}; all times are theirs"}
    return _OTHER_DRIVERS + "[board]\n" + toml_lines({key: getattr(board, key) for key in notes}, notes)


def _joint_text(joint: NewJoint, *, is_coupled: bool) -> str:
    coupled = {"axis_speed_max": joint.speed_max, "axis_acceleration_max": joint.acceleration_max}
    main = {
        "unit": joint.unit.value,
        "lower": joint.lower,
        "upper": joint.upper,
        "speed_max": joint.speed_max,
        "acceleration_max": joint.acceleration_max,
        **(coupled if is_coupled else {}),
        "full_steps_per_rev": FULL_STEPS_PER_REV,
        "microsteps": joint.microsteps,
        joint.turn_key: joint.turn,
    }
    notes = {
        "speed_max": f"{joint.unit}/s, {joint.speed_max * joint.transmission.steps_per_unit:.0f} steps/s",
        "acceleration_max": f"{joint.unit}/s2",
        "full_steps_per_rev": "a motor of 1.8 deg",
        "axis_speed_max": "the motor's own limit: along a diagonal it turns for both slides",
        "axis_acceleration_max": "likewise",
        "microsteps": f"{joint.microsteps_made}, as the driver is set",
        joint.turn_key: _TURN_NOTES[joint.unit],
    }
    return "\n".join(
        [
            f"[joints.{joint.name}] # {joint.what}\n" + toml_lines(main, notes),
            f"[joints.{joint.name}.switches] # closed from here outwards\n" + toml_lines(joint.switches, {}),
            f"[joints.{joint.name}.homing]\n"
            + toml_lines(
                joint.homing, {"method": "the negative limit switch, leaving it upwards; 35 without a switch"}
            ),
        ]
    )


def _comment(text: str) -> str:
    return "".join(f"# {line}\n" for line in text.splitlines())


def _devices(kind: str, joints: list[NewJoint]) -> str:
    """Return outputs and places: those of the robot that StepTwin brings, its places within the ranges."""
    if kind not in robot_names():
        return _OUTPUTS.format(joint=joints[-1].name)
    robot, ranges = load_robot(kind), {joint.name: (joint.lower, joint.upper) for joint in joints}
    parts = []
    if robot.outputs:
        rows = [
            f'{name} = {{ joint = "{output.joint}", out = {output.out} }}' for name, output in robot.outputs.items()
        ]
        parts.append("\n".join(["[outputs] # the axis and the number of each digital output", *rows, ""]))
    for place, positions in robot.places.items():
        near = {name: min(max(position, ranges[name][0]), ranges[name][1]) for name, position in positions.items()}
        parts.append(f"[places.{place}] # where jobs go\n" + toml_lines(near, {}))
    return "\n".join(parts) if parts else _OUTPUTS.format(joint=joints[-1].name)


def _joints_of(robot: Robot) -> list[NewJoint]:
    comments = dict(_COMMENT.findall(robot.toml))
    return [
        NewJoint(
            joint.name,
            joint.unit,
            comments.get(joint.name, "joint"),
            joint.lower,
            joint.upper,
            joint.transmission.travel_per_turn if joint.unit is Unit.MM else joint.transmission.ratio,
            joint.transmission.microsteps,
            home,
        )
        for joint, home in zip(robot.joints, robot.home, strict=True)
    ]
