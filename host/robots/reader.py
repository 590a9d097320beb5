"""Read a robot's TOML file. Every error begins with the file and the key, as in `joints.th1.microsteps: ...`.

The keys of each table are data: a mapping from the key to the function that reads its value. All that is wrong in a
file is found at once.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final, TypeVar

from steptwin.host.common.bad_input import apart, at_most, prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX, TITLE_CHARS_MAX
from steptwin.host.common.findings import Findings, check_all
from steptwin.host.common.tables import Reading, Table, check_name, number_at, toml_table
from steptwin.host.robots.board_settings import ActiveEdge, BoardSettings
from steptwin.host.robots.box import Box, Range
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.digital_input import Input
from steptwin.host.robots.fewer_steps import with_fewer_steps
from steptwin.host.robots.homing import JointHoming
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics import check_dimensions, make_kinematics
from steptwin.host.robots.output import Output
from steptwin.host.robots.robot import Dimension, Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.robots.transmission import Transmission

_Made = TypeVar("_Made")

_ROUNDING: Final = 1e-9
"""Rounding error allowed beyond the driver's step rate, as a fraction of it: most steps per degree are inexact."""


def parse_robot(text: str, source: str) -> Robot:
    """Return the robot that a TOML text describes; raise InputError, with `source` and the key, for a wrong text."""
    with prefixed(f"{source}: "):
        return read_robot(text)


def read_robot(text: str) -> Robot:
    """Return the same robot; the messages of the InputError are everything that is wrong, each with its key."""
    robot = replace(_robot(toml_table(text)), toml=text)
    check_all(partial(make_kinematics, robot), partial(_check_speeds, robot))
    return robot


def _robot(table: Table) -> Robot:
    values = table.read(_ROBOT, _ROBOT_OPTIONAL)
    kind, geometry = values["kinematics"]
    joints: dict[str, Joint] = values["joints"]
    with prefixed("coupling: "):
        coupling = Coupling.of(tuple(joints), values["coupling"] or {})
    return Robot(
        name=values["name"],
        title=values["title"],
        kinematics=kind,
        geometry=geometry,
        joints=tuple(joints.values()),
        home=tuple(values["home"].values()),
        board=values["board"],
        outputs=values["outputs"] or {},
        inputs=values["inputs"] or {},
        places=values["places"] or {},
        boxes=values["boxes"] or {},
        coupling=coupling,
    )


def _name(table: Table, key: str) -> str:
    return table.name(key, NAME_CHARS_MAX)


def _title(table: Table, key: str) -> str:
    return table.name(key, TITLE_CHARS_MAX)


def _mechanism(table: Table, key: str) -> tuple[str, dict[str, Dimension]]:
    """Return the kind of the mechanism and its dimensions, which are checked here as far as they need no joints."""
    with table.section(key) as section:
        kind = section.text("kind")
        dimensions = section.read({name: _dimension for name in section if name != "kind"}, {"kind": Table.text})
    del dimensions["kind"]
    check_dimensions(kind, dimensions)
    return kind, dimensions


def _dimension(table: Table, key: str) -> Dimension:
    if isinstance(table.values[key], bool):
        return table.truth(key)
    return table.text(key) if isinstance(table.values[key], str) else table.number(key)


def _each(read: Callable[[Table, str], _Made], table: Table, key: str) -> dict[str, _Made]:
    """Return what `read` makes of every key in the table under a key, where the keys are names."""
    made, findings = {}, Findings()
    with table.section(key) as section:
        for name in section:
            check_name(name, NAME_CHARS_MAX)
        for name in section:
            with findings.collecting():
                made[name] = read(section, name)
        findings.raise_first()
    return made


def _home(table: Table, key: str) -> dict[str, float]:
    """Return a position for every joint that the table of joints names, right or wrong."""
    joints = table.values.get("joints")
    with table.section(key) as section:
        return section.read(dict.fromkeys(joints if isinstance(joints, dict) else section, Table.number))


def _settings(make: Callable[..., _Made], required: dict[str, Reading], optional: dict[str, Reading]) -> Reading:
    """Return a reading of a table whose keys are the parameters of `make`."""

    def read(table: Table, key: str) -> _Made:
        with table.section(key) as section:
            return make(**section.read(required, optional))

    return read


def _joint(tables: Table, name: str) -> Joint:
    with tables.section(name) as table:
        unit = table.choice("unit", Unit)
        turn = _TURN[unit]
        values = table.read(_JOINT | dict.fromkeys(turn, Table.number), _JOINT_OPTIONAL)
        del values["unit"]
        motor = {key: values.pop(key) for key in ("full_steps_per_rev", "microsteps", *turn)}
        transmission = Transmission(**({"travel_per_turn": 360.0} | motor))
        switches = values.pop("switches") or JointSwitches()
        return Joint(name, unit, **values, transmission=transmission, switches=switches)


def _range(table: Table, key: str) -> Range:
    ends = table.elements(key)
    if len(ends) != 2:
        raise InputError(f"{key}: has {len(ends)} values, but a box has two ends: [from, to]")
    first, last = (number_at(f"{key}[{i}]", end) for i, end in enumerate(ends))
    return first, last


def _box(tables: Table, name: str) -> Box:
    with tables.section(name) as table:
        values = table.read(dict.fromkeys(("x_mm", "y_mm", "z_mm"), _range), {"held_by": Table.text})
        return Box(**values | {"held_by": values["held_by"] or ""})


_place: Final = partial(_each, Table.number)
_output: Final = _settings(Output, {"joint": Table.text, "out": Table.integer}, {})
_input: Final = _settings(Input, {"joint": Table.text, "input": Table.integer}, {})

_ROBOT: Final[dict[str, Reading]] = {
    "name": _name,
    "title": _title,
    "kinematics": _mechanism,
    "board": _settings(
        BoardSettings,
        {
            "bitrate": Table.integer,
            "steplen_ns": Table.integer,
            "stepspace_ns": Table.integer,
            "dirsetup_ns": Table.integer,
            "dirhold_ns": Table.integer,
            "step_rate_max_hz": Table.number,
        },
        {
            "osc_pf": Table.integer,
            "driver_profile": Table.text,
            "current_a": Table.number,
            "active_edge": lambda table, key: table.choice(key, ActiveEdge),
            "idle_percent": Table.integer,
            "fast_decay_percent": Table.integer,
        },
    ),
    "joints": partial(_each, _joint),
    "home": _home,
}
_ROBOT_OPTIONAL: Final[dict[str, Reading]] = {
    "coupling": partial(_each, _place),
    "outputs": partial(_each, _output),
    "inputs": partial(_each, _input),
    "places": partial(_each, _place),
    "boxes": partial(_each, _box),
}
_JOINT: Final[dict[str, Reading]] = {
    "unit": Table.text,
    "lower": Table.number,
    "upper": Table.number,
    "speed_max": Table.number,
    "acceleration_max": Table.number,
    "full_steps_per_rev": Table.integer,
    "microsteps": Table.integer,
}
_TURN: Final = {Unit.MM: ("travel_per_turn",), Unit.DEG: ("ratio",)}
"""The key of the transmission, by the joint's unit."""
_JOINT_OPTIONAL: Final[dict[str, Reading]] = {
    "axis_speed_max": Table.number,
    "axis_acceleration_max": Table.number,
    "switches": _settings(
        JointSwitches,
        {},
        dict.fromkeys(("negative_limit", "positive_limit", "home_from", "home_to"), Table.number),
    ),
    "homing": _settings(
        JointHoming,
        {
            "method": Table.integer,
            "search_speed": Table.number,
            "zero_speed": Table.number,
            "acceleration": Table.number,
        },
        {},
    ),
}


def _check_speeds(robot: Robot) -> None:
    """Raise InputError if joints' highest speeds need higher step rates than the driver's limit."""
    check_all(*(partial(_check_speed, joint, robot.board.driver_rate_max_hz) for joint in robot.joints))


def _check_speed(joint: Joint, limit_hz: float) -> None:
    if joint.step_rate_max_hz > limit_hz * (1 + _ROUNDING):
        key, speed = (
            ("axis_speed_max", joint.axis_speed_max) if joint.axis_speed_max else ("speed_max", joint.speed_max)
        )
        rate, limit = apart(joint.step_rate_max_hz / 1e3, limit_hz / 1e3)
        fastest = at_most(limit_hz / joint.transmission.steps_per_unit * (1 + _ROUNDING / 2))
        _, drive = with_fewer_steps(joint, limit_hz / joint.step_rate_max_hz)
        raise InputError(
            f"joints.{joint.name}.{key}: {speed:g} {joint.unit}/s takes {rate} kHz of steps,"
            f" more than the driver's {limit} kHz; {key} = {fastest} or {drive} would do"
        )
