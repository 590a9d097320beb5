"""Read a robot's TOML file. Every error begins with the file and the key, as in `joints.th1.microsteps: ...`.

The keys of each table are data: a mapping from the key to the function that reads its value. All that is wrong in a
file is found at once: every table is judged as far as its values can be read (`judged`), and what depends on a wrong or
missing value is not judged.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from reprlib import repr as short
from typing import Final, NoReturn, TypeVar

from steptwin.host.common.bad_input import apart, at_most, nearest, prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.file_limits import NAME_CHARS_MAX, PAPER_CHARS_MAX, TITLE_CHARS_MAX
from steptwin.host.common.findings import Findings, UnreadError, check_all, judged, part_of
from steptwin.host.common.tables import Reading, Table, check_name, integer_from, number_at, number_from, toml_table
from steptwin.host.robots.board_settings import BoardSettings, Input, Output, named_profile, pulses_for
from steptwin.host.robots.box import Box, Range
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.joint import Joint, SecondMotor, Transmission, Unit, with_fewer_steps
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import check_names, check_unit, keys_of
from steptwin.host.robots.kinematics.chain import check_links
from steptwin.host.robots.kinematics.dh import DhTable
from steptwin.host.robots.kinematics.kinds import kind_named
from steptwin.host.robots.link_errors import QUANTITIES, LinkErrors
from steptwin.host.robots.motor import MOTOR_KEYS, Dynamics, JointLink, JointMotor
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.robots.robot import Dimension, Robot
from steptwin.host.robots.switches import JointHoming, JointSwitches
from steptwin.protocol.drivers import ActiveEdge, DriverFigures
from steptwin.protocol.od import MICROSTEPS_CHOICES, TIMING_NS_MAX

_Made = TypeVar("_Made")

_ROUNDING: Final = 1e-9
"""Rounding error allowed beyond the driver's step rate, as a fraction of it: most steps per degree are inexact."""


def parse_robot(text: str, source: str) -> Robot:
    """Return the robot that a TOML text describes; raise InputError, with `source` and the key, for a wrong text."""
    with prefixed(f"{source}: "):
        return read_robot(text)


def read_robot(text: str) -> Robot:
    """Return the robot that a text describes; the InputError's messages are all that is wrong, each with its key."""
    table = toml_table(text)
    if "step" in table and not any(key in table for key in ("kinematics", "joints", "board")):
        raise InputError("is a program, not a robot: its robot's name or file stands before it")
    robot, findings = _robot(table), table.findings
    if not findings.messages:
        with findings.collecting():
            make_kinematics(robot)
    with findings.collecting():
        _check_speeds(robot)
    findings.raise_first()
    return replace(robot, toml=text)


def _robot(table: Table) -> Robot:
    """Return the robot, or the part of it that is right; what is wrong goes to the table's findings."""
    kind = _kind_ahead(table)
    sections: dict[str, Reading] = {feature.name: read for feature, read in giving("section")}
    required: dict[str, Reading] = {**_ROBOT, "joints": partial(_joints, kind), "home": partial(_home, kind)}
    own: dict[str, Reading] = {
        **_ROBOT_OPTIONAL,
        "coupling": partial(_coupling, kind),
        "dh_errors": partial(_dh_errors, kind),
    }
    optional = own | sections
    values = table.gather(required, optional | _of_missing_features(table, required | optional))
    read = {name: values.pop(name, None) for name in sections}
    values["sections"] = {name: section for name, section in read.items() if section is not None}
    joints: dict[str, Joint] = values.get("joints", {})
    if joints:
        values["joints"] = tuple(joints.values())
        if "coupling" in values:
            values["coupling"] = _with_second_motors(values["coupling"] or Coupling(), values["joints"])
    if joints and "home" in values:
        values["home"] = tuple(values["home"].get(name, _some_position(joint)) for name, joint in joints.items())
    if "kinematics" in values:
        values["geometry"] = values["kinematics"].dimensions
        values["kinematics"] = values["kinematics"].name
    return judged(Robot, {**values, "toml": ""}, table.findings)


def _of_missing_features(table: Table, known: Iterable[str]) -> dict[str, Reading]:
    """Return readings for tables that belong to no installed feature, unless their names are slips of the pen."""

    def read(_: Table, key: str) -> NoReturn:
        raise InputError(f"{shortened(key)}: no feature that is installed has a table of this name")

    known = list(known)
    strange = (key for key, value in table.values.items() if isinstance(value, dict) and key not in known)
    return {key: read for key in strange if not nearest(key, known)}


def _some_position(joint: Joint) -> float:
    """Return a position that stands for an unread one, so that those of the other joints can be judged."""
    try:
        return joint.lower
    except UnreadError:
        return 0.0


def _name(table: Table, key: str) -> str:
    return table.name(key, NAME_CHARS_MAX)


def _title(table: Table, key: str) -> str:
    return table.name(key, TITLE_CHARS_MAX)


def _paper(table: Table, key: str) -> str:
    return table.name(key, PAPER_CHARS_MAX)


# --- the mechanism, which tells the names of the joints


@dataclass(frozen=True, slots=True)
class _Mechanism:
    """The kind of a mechanism, its dimensions, and the joints and the DH table that it has with them.

    Without the dimensions that decide on them there are no joints and no table.
    """

    name: str = ""
    dimensions: Mapping[str, Dimension] = field(default_factory=dict)
    joints: Mapping[str, Unit] = field(default_factory=dict)
    dh: DhTable | None = None


def _mechanism(table: Table, key: str) -> _Mechanism:
    with table.section(key) as section:
        name = section.text("kind")
    kind = kind_named(name)
    with table.section(key) as section:
        required, optional = keys_of(kind.geometry)
        values = section.gather({"kind": Table.text, **required}, optional)
        del values["kind"]
        geometry = judged(kind.geometry, values, section.findings)
    joints: dict[str, Unit] = {}
    dh: DhTable | None = None
    with Findings().collecting():
        joints = geometry.joints
    with Findings().collecting():
        dh = geometry.dh
    return _Mechanism(name, {name: value for name, value in values.items() if value is not None}, joints, dh)


def _kind_ahead(table: Table) -> _Mechanism:
    """Return the mechanism for those who read the other tables; what is wrong with it is found when it is read."""
    with Findings().collecting():
        return _mechanism(Table(table.values, "table"), "kinematics")
    return _Mechanism()


# --- joints


def _joints(kind: _Mechanism, table: Table, key: str) -> dict[str, Joint]:
    """Return the joints of the file and of the kind; of those that are wrong, the parts that are right."""
    joints = each_of(partial(_joint, kind), table, key)
    with table.section(key) as section:
        if kind.joints:
            with table.findings.collecting():
                own = [name for name in section if name not in kind.joints or not _headless(section, name)]
                check_names(kind.name, own, kind.joints)
        return {name: joints.get(name, part_of(Joint, {"name": name})) for name in {**section.values, **kind.joints}}


def _headless(joints: Table, name: str) -> bool:
    """Return whether there are only tables of a joint, such as [joints.d3.homing], but nothing in [joints.d3]."""
    joint = joints.values[name]
    return isinstance(joint, dict) and bool(joint) and joint.keys() <= _JOINT_TABLES.keys()


def _joint(kind: _Mechanism, joints: Table, name: str) -> Joint:
    expected = kind.joints.get(name)
    with joints.section(name) as table:
        if kind.joints and not expected and (not table.values or _headless(joints, name)):
            raise UnreadError(name)  # it is probably another joint's: `check_names` says so
        if expected and _headless(joints, name):  # it is missing, as `check_names` says
            return judged(Joint, {"name": name, "unit": expected, **table.gather({}, _JOINT_TABLES)}, table.findings)
        unit = _probable_unit(table, expected)
        turn = {_TURN[unit]: Table.number} if unit else {}
        either = {} if unit else dict.fromkeys(_TURN.values(), Table.number)
        values = table.gather(
            {"unit": partial(_unit, expected), **_JOINT, **turn}, {**_JOINT_OPTIONAL, **_JOINT_TABLES, **either}
        )
        motor = {key: values.pop(key) for key in ("full_steps_per_rev", "microsteps", *turn) if key in values}
        for key in either:  # without a unit, which of them is missing is unknown
            if (value := values.pop(key, None)) is not None:
                motor[key] = value
        fixed = {Unit.MM: {"ratio": 1.0}, Unit.DEG: {"travel_per_turn": 360.0}, None: {}}[unit]
        transmission = judged(Transmission, motor | fixed, table.findings)
        given = values | ({"unit": unit} if unit else {})
        return judged(Joint, {"name": name, "transmission": transmission, **given}, table.findings)


def _probable_unit(table: Table, expected: Unit | None) -> Unit | None:
    """Return the unit by which a joint's other keys are read: the file's, or the expected one if these keys fit it."""
    given = next((unit for unit in Unit if unit == table.values.get("unit")), expected)
    return expected if given and expected and _TURN[given] not in table and _TURN[expected] in table else given


def _unit(expected: Unit | None, table: Table, key: str) -> Unit:
    unit = table.choice(key, Unit)
    if expected:
        check_unit(unit, expected)
    return unit


def _home(kind: _Mechanism, table: Table, key: str) -> dict[str, float]:
    """Return a position for every joint; those that only the file or only the kind has may be left out."""
    joints = table.values.get("joints")
    with table.section(key) as section:
        names = list(joints) if isinstance(joints, dict) else list(section)
        sure = [name for name in names if name in kind.joints or not kind.joints]
        known = section.gather(dict.fromkeys(sure, Table.number), dict.fromkeys([*names, *kind.joints], Table.number))
        return {name: position for name, position in known.items() if position is not None}


def _coupling(kind: _Mechanism, table: Table, key: str) -> Coupling:
    joints = table.values.get("joints")
    names = tuple(dict.fromkeys([*(joints if isinstance(joints, dict) else ()), *kind.joints]))
    with table.section(key) as section:
        rows = {axis: row for axis, row in section.values.items() if isinstance(row, dict)}
    before = len(table.findings.messages)
    with table.findings.collecting(f"{key}: "):
        Coupling.check_names(names, rows)
    elements = each_of(_places, table, key)
    if len(table.findings.messages) > before:
        raise UnreadError(key)
    with prefixed(f"{key}: "):
        return Coupling.of(names, elements)


def _with_second_motors(coupling: Coupling, joints: Sequence[Joint]) -> Coupling:
    """Return a coupling with the second motors of the joints, as far as the file's could be read."""
    seconds = []
    for i, joint in enumerate(joints):
        with suppress(UnreadError):
            seconds += [i] if joint.second_motor else []
    return coupling.with_second_motors(len(joints), seconds)


# --- errors of the DH parameters


def _dh_errors(kind: _Mechanism, table: Table, key: str) -> dict[str, LinkErrors]:
    """Return the errors of each link; if the mechanism is unknown, so are its links."""
    if kind.dh:
        with table.section(key) as section, table.findings.collecting(f"{key}: "):
            check_links(kind.name, kind.dh, kind.joints, section)
    return each_of(_link_errors, table, key)


# --- tables whose keys are names


def each_of(read: Callable[[Table, str], _Made], table: Table, key: str) -> dict[str, _Made]:
    """Return what `read` makes of every key in the table under a key, where the keys are names."""
    with table.section(key) as section:
        return section.gather({name: read if _is_name(section, name) else _not_read for name in section})


def _is_name(section: Table, key: str) -> bool:
    with section.findings.collecting():
        check_name(key, NAME_CHARS_MAX)
        return True
    return False


def _not_read(_: Table, key: str) -> NoReturn:
    raise UnreadError(key)


def _places(table: Table, key: str) -> dict[str, float]:
    positions = each_of(Table.number, table, key)
    if not positions and table.values[key]:
        raise UnreadError(key)
    return positions


def settings(make: type[_Made], required: dict[str, Reading], optional: dict[str, Reading]) -> Reading:
    """Return a reading of a table whose keys are the fields of `make`."""

    def read(table: Table, key: str) -> _Made:
        with table.section(key) as section:
            return judged(make, section.gather(required, optional), section.findings)

    return read


def _range(table: Table, key: str) -> Range:
    ends = table.elements(key)
    if len(ends) != 2:
        raise InputError(f"{key}: has {len(ends)} values, but a box has two ends: [from, to]")
    first, last = (number_at(f"{key}[{i}]", end) for i, end in enumerate(ends))
    return first, last


def read_point(table: Table, key: str) -> tuple[float, float, float]:
    coordinates = table.elements(key)
    if len(coordinates) != len(_COORDINATES):
        raise InputError(f"{key}: has {len(coordinates)} values, but a point has three: [x, y, z]")
    x_mm, y_mm, z_mm = (number_at(f"{key}[{i}]", value) for i, value in enumerate(coordinates))
    return x_mm, y_mm, z_mm


def read_texts(table: Table, key: str) -> tuple[str, ...]:
    texts = table.elements(key)
    if strange := [f"{key}[{i}]: {short(text)} is not a text" for i, text in enumerate(texts) if type(text) is not str]:
        raise InputError(*strange)
    return tuple(map(str, texts))


_COORDINATES: Final = ("x", "y", "z")
_box: Final = settings(Box, dict.fromkeys(("x_mm", "y_mm", "z_mm"), _range), {"held_by": Table.text})
_link_errors: Final = settings(LinkErrors, {}, dict.fromkeys(QUANTITIES, Table.number))
_output: Final = settings(Output, {"joint": Table.text, "out": Table.integer}, {})
_input: Final = settings(Input, {"joint": Table.text, "input": Table.integer}, {})


# --- the board


def _modes(table: Table, key: str) -> tuple[int, ...]:
    modes = table.elements(key)
    if strange := [
        f"{key}[{i}]: {short(mode)} is not one of {', '.join(map(str, MICROSTEPS_CHOICES))}"
        for i, mode in enumerate(modes)
        if mode not in MICROSTEPS_CHOICES
    ]:
        raise InputError(*strange)
    if not modes:
        raise InputError(f"{key}: is empty; it lists the microsteps that the driver has")
    return tuple(mode for mode in MICROSTEPS_CHOICES if mode in modes)


_PULSES: Final[dict[str, Reading]] = {
    **dict.fromkeys(("steplen_ns", "stepspace_ns", "dirsetup_ns", "dirhold_ns"), Table.integer),
    "step_rate_max_hz": Table.number,
}
_SETTLING_MAX_NS: Final = 10**10
"""Ten seconds: a driver that takes longer until its first step is none."""
_figures: Final = settings(
    DriverFigures,
    {
        "microsteps": _modes,
        **dict.fromkeys(
            ("steplen_ns", "stepspace_ns", "dirsetup_ns", "dirhold_ns"), integer_from(0, TIMING_NS_MAX // 2)
        ),
    },
    {
        **dict.fromkeys(("enable_ns", "wake_ns"), integer_from(0, _SETTLING_MAX_NS)),
        "step_rate_max_hz": integer_from(1),
        "counts_while_off": Table.truth,
        "current_max_a": number_from(0.01, 100.0, "A"),
        "input_high_v": number_from(0.0, 100.0, "V"),
        "input_ma": number_from(0.0, 100.0, "mA"),
    },
)
_BOARD_OPTIONAL: Final[dict[str, Reading]] = {
    "bitrate": Table.integer,
    "osc_pf": Table.integer,
    "driver_profile": Table.text,
    "driver": _figures,
    "current_a": Table.number,
    "active_edge": lambda table, key: table.choice(key, ActiveEdge),
    "idle_percent": Table.integer,
    "fast_decay_percent": Table.integer,
    "fault_wired": Table.truth,
}


def _board(table: Table, key: str) -> BoardSettings:
    """Return the board's settings; drivers that the file names bring the times that it leaves out."""
    with table.section(key) as section:
        if "driver_profile" not in section:
            return judged(BoardSettings, section.gather(_PULSES, _BOARD_OPTIONAL), section.findings)
        values = section.gather({}, _PULSES | _BOARD_OPTIONAL)
        times: dict[str, int] = {}
        with suppress(UnreadError):
            profile = named_profile(values.get("driver_profile", ""), values.get("driver"))
            times = pulses_for(profile, values.get("active_edge")) if profile is not None else {}
        brought = {name: times.get(name) for name in _PULSES if name in values and values[name] is None}
        known = {name: value for name, value in values.items() if name not in brought}
        known |= {name: value for name, value in brought.items() if value is not None}
        return judged(BoardSettings, known, section.findings)


_ROBOT: Final[dict[str, Reading]] = {
    "name": _name,
    "title": _title,
    "kinematics": _mechanism,
    "board": _board,
}
_ROBOT_OPTIONAL: Final[dict[str, Reading]] = {
    "base": settings(BaseFrame, {}, dict.fromkeys(("x_mm", "y_mm", "z_mm", "phi_deg"), Table.number)),
    "paper": _paper,
    "outputs": partial(each_of, _output),
    "inputs": partial(each_of, _input),
    "places": partial(each_of, _places),
    "boxes": partial(each_of, _box),
    "dynamics": settings(
        Dynamics,
        {"supply_v": Table.number},
        {
            **dict.fromkeys(("supply_ohm", "supply_uf", "payload_kg"), Table.number),
            "payload_held_by": Table.text,
        },
    ),
}
_JOINT: Final[dict[str, Reading]] = {
    "lower": Table.number,
    "upper": Table.number,
    "speed_max": Table.number,
    "acceleration_max": Table.number,
    "full_steps_per_rev": Table.integer,
    "microsteps": Table.integer,
}
_TURN: Final = {Unit.MM: "travel_per_turn", Unit.DEG: "ratio"}
"""The key of the transmission, by the joint's unit."""
_JOINT_OPTIONAL: Final[dict[str, Reading]] = {
    "axis_speed_max": Table.number,
    "axis_acceleration_max": Table.number,
    "current_a": Table.number,
}
_LINK_OPTIONAL: Final[dict[str, Reading]] = {
    **dict.fromkeys(("centre_mm", "inertia_kgm2"), read_point),
    **dict.fromkeys(("stop_lower", "stop_upper"), Table.number),
}
_JOINT_TABLES: Final[dict[str, Reading]] = {
    "switches": settings(
        JointSwitches,
        {},
        dict.fromkeys(("negative_limit", "positive_limit", "home_from", "home_to"), Table.number),
    ),
    "homing": settings(
        JointHoming,
        {
            "method": Table.integer,
            "search_speed": Table.number,
            "zero_speed": Table.number,
            "acceleration": Table.number,
        },
        {},
    ),
    "second_motor": settings(SecondMotor, {"name": _name, "skew_max": Table.number}, {"square_offset": Table.number}),
    "motor": settings(JointMotor, {}, {"model": Table.text, **dict.fromkeys(MOTOR_KEYS, Table.number)}),
    "link": settings(JointLink, {"mass_kg": Table.number}, _LINK_OPTIONAL),
}


def _check_speeds(robot: Robot) -> None:
    """Raise InputError if joints' highest speeds need higher step rates than the driver's limit."""
    check_all(*(partial(_check_speed, joint, robot.board) for joint in robot.joints))


def _check_speed(joint: Joint, board: BoardSettings) -> None:
    limit_hz = board.driver_rate_max_hz
    if joint.step_rate_max_hz > limit_hz * (1 + _ROUNDING):
        key, speed = (
            ("axis_speed_max", joint.axis_speed_max) if joint.axis_speed_max else ("speed_max", joint.speed_max)
        )
        rate, limit = apart(joint.step_rate_max_hz / 1e3, limit_hz / 1e3)
        fastest = at_most(limit_hz / joint.transmission.steps_per_unit * (1 + _ROUNDING / 2))
        _, drive = with_fewer_steps(joint, limit_hz / joint.step_rate_max_hz, board.profile.chip.microsteps)
        raise InputError(
            f"joints.{joint.name}.{key}: {speed:g} {joint.unit}/s takes {rate} kHz of steps,"
            f" more than the driver's {limit} kHz; {key} = {fastest} or {drive} would do"
        )
