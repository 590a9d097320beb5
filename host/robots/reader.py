"""Read a robot's TOML file. Every error begins with the file and the key, as in `joints.th1.microsteps: ...`."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Final

from steptwin.host.common.bad_input import apart, prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX, TITLE_CHARS_MAX
from steptwin.host.common.tables import Table, check_name, toml_table
from steptwin.host.robots.board_settings import ActiveEdge, BoardSettings
from steptwin.host.robots.homing import JointHoming
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.output import Output
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.robots.transmission import Transmission


def parse_robot(text: str, source: str) -> Robot:
    """Return the robot that a TOML text describes; raise InputError, with `source` and the key, for a wrong text."""
    with prefixed(f"{source}: "):
        table = toml_table(text)
        robot = replace(_robot(table), toml=text)
        make_kinematics(robot)  # only to check kind and dimensions
        _check_speeds(robot)
        return robot


_ROBOT: Final = ("name", "title", "kinematics", "board", "joints", "home", "outputs", "places")
_JOINT: Final = (
    *("unit", "lower", "upper", "speed_max", "acceleration_max", "full_steps_per_rev", "microsteps"),
    *("travel_per_turn", "ratio", "switches", "homing"),
)
_OF_ANOTHER_UNIT: Final = {Unit.MM: "ratio", Unit.DEG: "travel_per_turn"}


@contextmanager
def _section(table: Table, key: str, known: Iterable[str] | None = None, *, optional: bool = False) -> Iterator[Table]:
    """Enter the table under a key; a missing optional table is empty.

    A key that is not known is an error before any is read: a mistyped key is named, not the key that it should be. With
    None, the keys are names that the file gives.
    """
    if optional and key not in table:
        yield Table({}, "table")
        return
    with table.section(key) as section:
        if known is not None:
            section.check_keys(known)
        yield section


def _keys(settings: "type[BoardSettings | JointHoming | JointSwitches | Output]") -> list[str]:
    """Return the keys of a table that has one for each field of a dataclass."""
    return [field.name for field in fields(settings)]


@contextmanager
def _named_tables(table: Table, key: str, *, optional: bool = False) -> Iterator[Table]:
    """Enter the table under a key, whose keys are names."""
    with _section(table, key, optional=optional) as section:
        for name in section:
            check_name(name, NAME_CHARS_MAX)
        yield section


def _robot(table: Table) -> Robot:
    table.check_keys(_ROBOT)
    name, title = table.name("name", NAME_CHARS_MAX), table.name("title", TITLE_CHARS_MAX)
    with _section(table, "kinematics") as mechanism:
        kind = mechanism.text("kind")
        geometry = {key: mechanism.number(key) for key in mechanism if key != "kind"}
    with _section(table, "board", _keys(BoardSettings)) as settings:
        board = _board(settings)
    with _named_tables(table, "joints") as tables:
        joints = tuple(_joint(tables, key) for key in tables)
    with _section(table, "home", [joint.name for joint in joints]) as positions:
        home = tuple(positions.number(joint.name) for joint in joints)
    with _named_tables(table, "outputs", optional=True) as wiring:
        outputs = {key: _output(wiring, key) for key in wiring}
    with _named_tables(table, "places", optional=True) as tables:
        places = {key: _place(tables, key) for key in tables}
    return Robot(name, title, kind, geometry, joints, home, board, outputs, places)


def _output(wiring: Table, name: str) -> Output:
    with _section(wiring, name, _keys(Output)) as table:
        return Output(joint=table.text("joint"), out=table.integer("out"))


def _place(tables: Table, name: str) -> dict[str, float]:
    with _section(tables, name) as table:
        return {joint: table.number(joint) for joint in table}


def _board(table: Table) -> BoardSettings:
    return BoardSettings(
        bitrate=table.integer("bitrate"),
        osc_pf=table.optional("osc_pf", table.integer),
        steplen_ns=table.integer("steplen_ns"),
        stepspace_ns=table.integer("stepspace_ns"),
        dirsetup_ns=table.integer("dirsetup_ns"),
        dirhold_ns=table.integer("dirhold_ns"),
        step_rate_max_hz=table.number("step_rate_max_hz"),
        driver_profile=table.optional("driver_profile", table.text),
        current_a=table.optional("current_a", table.number),
        active_edge=table.choice("active_edge", ActiveEdge) if "active_edge" in table else None,
        idle_percent=table.optional("idle_percent", table.integer),
        fast_decay_percent=table.optional("fast_decay_percent", table.integer),
    )


def _joint(tables: Table, name: str) -> Joint:
    with _section(tables, name, _JOINT) as table:
        unit = table.choice("unit", Unit)
        table.check_keys(key for key in _JOINT if key != _OF_ANOTHER_UNIT[unit])
        return Joint(
            name=name,
            unit=unit,
            lower=table.number("lower"),
            upper=table.number("upper"),
            speed_max=table.number("speed_max"),
            acceleration_max=table.number("acceleration_max"),
            transmission=_transmission(table, unit),
            switches=_switches(table),
            homing=_homing(table) if "homing" in table else None,
        )


def _switches(joint: Table) -> JointSwitches:
    with _section(joint, "switches", _keys(JointSwitches), optional=True) as table:
        return JointSwitches(
            negative_limit=table.optional("negative_limit", table.number),
            positive_limit=table.optional("positive_limit", table.number),
            home_from=table.optional("home_from", table.number),
            home_to=table.optional("home_to", table.number),
        )


def _homing(joint: Table) -> JointHoming:
    with _section(joint, "homing", _keys(JointHoming)) as table:
        return JointHoming(
            method=table.integer("method"),
            search_speed=table.number("search_speed"),
            zero_speed=table.number("zero_speed"),
            acceleration=table.number("acceleration"),
        )


def _transmission(table: Table, unit: Unit) -> Transmission:
    full_steps_per_rev, microsteps = table.integer("full_steps_per_rev"), table.integer("microsteps")
    if unit is Unit.MM:
        return Transmission(full_steps_per_rev, microsteps, travel_per_turn=table.number("travel_per_turn"))
    return Transmission(full_steps_per_rev, microsteps, travel_per_turn=360.0, ratio=table.number("ratio"))


def _check_speeds(robot: Robot) -> None:
    """Raise InputError if a joint's highest speed needs a higher step rate than the driver's limit."""
    limit_hz = robot.board.driver_rate_max_hz
    for joint in robot.joints:
        if joint.step_rate_max_hz > limit_hz:
            rate, limit = apart(joint.step_rate_max_hz / 1e3, limit_hz / 1e3)
            raise InputError(
                f"joints.{joint.name}.speed_max: {joint.speed_max:g} {joint.unit}/s takes {rate} kHz of steps,"
                f" more than the driver's {limit} kHz"
            )
