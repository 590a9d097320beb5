"""Write the file of a new robot: its kind, dimensions and transmissions, the rest with sensible defaults.

Speeds follow from the step rate that the driver takes, switches and homing from the ranges. The kinds of the robots
that StepTwin brings begin with these robots' values.
"""

import json
import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from enum import StrEnum
from math import floor, inf, log10
from typing import Any, Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.common.numbers import finite_number
from steptwin.host.robots import load_robot, read_robot, robot_names
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.joint import Transmission, Unit
from steptwin.host.robots.kinematics.bare_axes import AxesGeometry
from steptwin.host.robots.kinematics.base import dimensions, geometry_of, meaning
from steptwin.host.robots.kinematics.cartesian import CartesianGeometry
from steptwin.host.robots.kinematics.kinds import kind_named
from steptwin.host.robots.kinematics.serial.chain_geometry import ChainGeometry
from steptwin.host.robots.kinematics.usual_scara import ScaraGeometry
from steptwin.host.robots.robot import Dimension, Robot

BOARD: Final = BoardSettings(
    osc_pf=330,
    steplen_ns=33_000,
    stepspace_ns=33_666,
    dirsetup_ns=15_000,
    dirhold_ns=15_000,
    step_rate_max_hz=15_000,
)
"""Drivers as the robots that StepTwin brings have them."""

_BOARD_NOTES: Final = {
    "bitrate": "bit/s of the CAN bus",
    "osc_pf": "pF at the TB6560's OSC pin: no CLK pulse below 30 us",
    "steplen_ns": "CLK high: 10 % above those 30 us",
    "stepspace_ns": "CLK low: both together are 15 kHz",
    "dirsetup_ns": "DIR stable before CLK rises",
    "dirhold_ns": "DIR stable after CLK has risen",
    "step_rate_max_hz": "the TB6560's limit",
}

_MICROSTEPS: Final = "{}, {}, {} or {}".format(*BOARD.profile.chip.microsteps)
_FULL_STEPS_PER_REV: Final = 200
_RATE_PART: Final = 0.8
"""Part of the driver's highest step rate that a joint's highest speed takes."""
_MOTOR_SPEED_MAX_REV_S: Final = 8.0
"""Motor speed above which a stepper of this size has little torque left."""
_ROTARY_SPEED_MAX_DEG_S: Final = 180.0
"""A moderate speed for a joint that carries an arm."""
_RISE_S: Final = 0.2
"""Time from rest to the highest speed."""
_BEYOND: Final = 5.0
"""Distance in mm or degrees from the end of the range to the limit switch."""
_SEARCH_PART: Final = 0.25
_ZERO_PART: Final = 0.1
"""Speed of the search for the limit switch, and the slow speed across its edge as a part of that."""
_HOMING_METHOD: Final = 17


@dataclass(frozen=True, slots=True)
class NewJoint:
    """A joint of a new robot: what the file asks its user; the rest of the joint follows from it.

    Attributes:
        name: name, which the kind gives.
        unit: unit of its positions.
        what: what it is, in a few words.
        lower: least position; likewise upper.
        turn: a screw's lead or a pulley's circumference in mm, or the ratio of a rotary joint's transmission.
        microsteps: microsteps per full step.
        home: position after homing, or the nearest one in the range.
        speed_most: highest speed that the joint may have, where something else than motor and driver limits it.
    """

    name: str
    unit: Unit
    what: str
    lower: float
    upper: float
    turn: float
    microsteps: int
    home: float = 0.0
    speed_most: float = inf

    @property
    def turn_key(self) -> str:
        """The key of `turn` in the file."""
        return "travel_per_turn" if self.unit is Unit.MM else "ratio"

    @property
    def questions(self) -> dict[str, tuple[str, float]]:
        """Questions of the file to its user: the meaning and the present value, by key."""
        turn = "lead of the screw or circumference of the pulley" if self.unit is Unit.MM else "motor turns per turn"
        return {
            "lower": (f"least position in {self.unit}", self.lower),
            "upper": (f"greatest position in {self.unit}", self.upper),
            self.turn_key: (turn, self.turn),
            "microsteps": (f"microsteps, {_MICROSTEPS}", float(self.microsteps)),
        }

    @property
    def settings(self) -> dict[str, str]:
        """The values that may be set, by their key in the file: their names here."""
        return {"lower": "lower", "upper": "upper", self.turn_key: "turn", "microsteps": "microsteps", "home": "home"}

    @property
    def transmission(self) -> Transmission:
        """The transmission; InputError if a value is out of range."""
        try:
            BOARD.profile.mode(self.microsteps)
        except ValueError as error:
            raise InputError(f"microsteps: {error}") from error
        if self.unit is Unit.MM:
            return Transmission(_FULL_STEPS_PER_REV, self.microsteps, self.turn)
        return Transmission(_FULL_STEPS_PER_REV, self.microsteps, 360.0, self.turn)

    @property
    def speed_max(self) -> float:
        """A highest speed that driver and motor can follow, in two digits."""
        transmission = self.transmission
        by_rate = _RATE_PART * BOARD.driver_rate_max_hz / transmission.steps_per_unit
        by_motor = _MOTOR_SPEED_MAX_REV_S * transmission.travel_per_rev
        moderate = _ROTARY_SPEED_MAX_DEG_S if self.unit is Unit.DEG else by_motor
        return _two_digits(min(by_rate, by_motor, moderate, self.speed_most))


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

_COMMENT: Final = re.compile(r"^\[joints\.(\S+)\] # (.+)$", re.MULTILINE)


def usual_dimensions(kind: str) -> dict[str, Dimension]:
    """Return the dimensions with which a new robot of a kind begins; raise InputError for an unknown kind."""
    usual = {name: field.metadata["usual"] for name, field in dimensions(kind_named(kind).geometry).items()}
    return {name: deepcopy(value) for name, value in usual.items() if value not in (None, ())}


def questions_of(kind: str) -> dict[str, tuple[str, Dimension]]:
    """Return the questions of a new file about its dimensions: the meaning and the usual value, by key."""
    meanings = {key: meaning(field) for key, field in dimensions(kind_named(kind).geometry).items()}
    questions: dict[str, tuple[str, Dimension]] = {}
    for key, value in usual_dimensions(kind).items():
        if isinstance(value, dict):
            questions |= {
                f"{name}.{part}": (meanings[key], each[part]) for name, each in value.items() for part in each
            }
        else:
            questions[key] = (meanings[key], value)
    if kind == "cartesian":
        questions[_BELTS] = (f"{_COREXY} if two belts move X and Y together, else {_EACH}", _EACH)
    return questions


def usual_joints(kind: str, geometry: Mapping[str, Dimension]) -> list[NewJoint]:
    """Return the joints with which a new robot begins; raise InputError if the dimensions do not fit the kind."""
    made = geometry_of(kind_named(kind).geometry, geometry)
    if isinstance(made, AxesGeometry):
        return [_TURNTABLE]
    if isinstance(made, CartesianGeometry):
        return [_GANTRY_JOINTS[letter] for letter in made.axes]
    if isinstance(made, ChainGeometry):
        return [replace(usual, name=name) for name, usual in zip(made.joints, _CHAIN_JOINTS, strict=True)]
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
    geometry, findings, questions = usual_dimensions(kind), Findings(), questions_of(kind)
    for key in [key for key in settings if "." not in key or key in questions]:
        with findings.collecting():
            if key not in questions:
                raise _unknown_setting(kind, key, questions)
            _set(geometry, key, read_dimension(key, settings[key], questions[key][1]))
    findings.raise_first()
    own = {key: value for key, value in geometry.items() if key != _BELTS}
    joints = {joint.name: joint for joint in usual_joints(kind, own)}
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


def _unknown_setting(kind: str, key: str, geometry: Mapping[str, Dimension]) -> InputError:
    """Return the error for a key without a joint that is no dimension; one of a joint's values names its joints."""
    joints = usual_joints(kind, usual_dimensions(kind))
    of_joints = [f"{joint.name}.{key}" for joint in joints if key in joint.settings]
    if of_joints:
        return InputError(f"{key!r} is a joint's value: write {' or '.join(of_joints)}")
    return unknown("dimension", key, geometry)


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


def read_joint(joint: NewJoint, key: str, text: str) -> NewJoint:
    """Return a joint with one of its values changed."""
    if key not in joint.settings:
        raise unknown(f"{joint.name}: key", key, joint.settings)
    with prefixed(f"{joint.name}.{key}: "):
        value = finite_number(text.removeprefix("1/") if key == "microsteps" else text)
    changes: dict[str, Any] = {
        joint.settings[key]: int(value) if key == "microsteps" and value == int(value) else value
    }
    changed = replace(joint, **changes)
    with prefixed(f"{joint.name}."):
        _ = changed.transmission
    return changed


def robot_text(name: str, kind: str, geometry: Mapping[str, Dimension], joints: list[NewJoint]) -> str:
    """Return the text of a robot file; raise InputError, with everything that is wrong, if it would be no robot."""
    meanings = {key: meaning(field) for key, field in dimensions(kind_named(kind).geometry).items()}
    parts = [
        _HEAD.format(kind=kind, summary=kind_named(kind).summary),
        _lines({"name": name, "title": f"{name}, a robot of the kind {kind}"}, {}),
        _kinematics_text(kind, {key: value for key, value in geometry.items() if key != _BELTS}, meanings),
        _BASE,
        *([_coupling_text(geometry)] if kind == "cartesian" else []),
        _DRIVERS + "[board]\n" + _lines({key: getattr(BOARD, key) for key in _BOARD_NOTES}, _BOARD_NOTES),
        _JOINTS,
        *(_joint_text(joint) for joint in joints),
        "[home] # where the arm is taken after homing\n"
        + _lines({joint.name: min(max(joint.home, joint.lower), joint.upper) for joint in joints}, {}),
        _devices(kind, joints),
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
        return "".join(f"# {line}\n" for line in _COUPLING.splitlines())
    if not {"X", "Y"} <= set(geometry["axes"]):
        raise InputError(f"{_BELTS}: {_COREXY} moves X and Y, but axes is {geometry['axes']!r}")
    return _COUPLING


def _kinematics_text(kind: str, geometry: Mapping[str, Dimension], meanings: Mapping[str, str]) -> str:
    """Return the table of the mechanism; a dimension that is a table has a line for each of its entries."""
    flat = {key: value for key, value in geometry.items() if not isinstance(value, dict)}
    parts = ["[kinematics] # docs/robot-files.md has a drawing\n" + _lines({"kind": kind, **flat}, meanings)]
    for key, table in geometry.items():
        if isinstance(table, dict):
            rows = (f"{name} = {_toml(each)}\n" for name, each in table.items())
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
[coupling] # for CoreXY and H-bot: two motors move both slides; rows are axes, columns joints (docs/coupling.md)
X = { X = 1.0, Y = 1.0 }
Y = { X = -1.0, Y = 1.0 }
"""
_DRIVERS: Final = """\
# For drivers other than TB6560s on the board: driver_profile = "a4988" or another of docs/driver.md in place of osc_pf
# and all times, which then are those of the drivers. Any driver without a profile is "generic", by its manual's times.
"""
_JOINTS: Final = """\
# Joints in the order of their axes on the board. speed_max was derived from transmission and microsteps when this file
# was written: 80 % of the driver's step rate, at most 8 turns of the motor and 180 degrees a second. acceleration_max
# reaches it in 0.2 s.
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


def _joint_text(joint: NewJoint) -> str:
    speed, acceleration = joint.speed_max, _two_digits(joint.speed_max / _RISE_S)
    search = _two_digits(_SEARCH_PART * speed)
    main = {
        "unit": joint.unit.value,
        "lower": joint.lower,
        "upper": joint.upper,
        "speed_max": speed,
        "acceleration_max": acceleration,
        "full_steps_per_rev": _FULL_STEPS_PER_REV,
        "microsteps": joint.microsteps,
        joint.turn_key: joint.turn,
    }
    notes = {
        "speed_max": f"{joint.unit}/s, {speed * joint.transmission.steps_per_unit:.0f} steps/s",
        "acceleration_max": f"{joint.unit}/s2",
        "full_steps_per_rev": "a motor of 1.8 deg",
        "microsteps": f"{_MICROSTEPS}, as the driver is set",
        joint.turn_key: _TURN_NOTES[joint.unit],
    }
    switches = {"negative_limit": joint.lower - _BEYOND, "positive_limit": joint.upper + _BEYOND}
    homing = {
        "method": _HOMING_METHOD,
        "search_speed": search,
        "zero_speed": _two_digits(_ZERO_PART * search),
        "acceleration": acceleration,
    }
    return "\n".join(
        [
            f"[joints.{joint.name}] # {joint.what}\n" + _lines(main, notes),
            f"[joints.{joint.name}.switches] # closed from here outwards\n" + _lines(switches, {}),
            f"[joints.{joint.name}.homing]\n"
            + _lines(homing, {"method": "the negative limit switch, leaving it upwards; 35 without a switch"}),
        ]
    )


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
        parts.append(f"[places.{place}] # where jobs go\n" + _lines(near, {}))
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


def _lines(values: Mapping[str, object], notes: Mapping[str, str]) -> str:
    """Return a line for each value, its notes in one column."""
    rows = {key: f"{key} = {_toml(value)}" for key, value in values.items()}
    width = max(map(len, rows.values()))
    return "".join(f"{row:<{width}} # {notes[key]}\n" if key in notes else f"{row}\n" for key, row in rows.items())


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(each)}' for key, each in value.items())} }}"
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(str(value), ensure_ascii=False) if isinstance(value, str) else repr(value)


def _two_digits(value: float) -> float:
    """Return a value above 0 rounded down to two digits."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{floor(value / unit * (1 + 1e-12)) * unit:.3g}")
