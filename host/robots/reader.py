"""Read a robot's TOML file. Every error begins with the file and the key, as in `joints.th1.microsteps: ...`."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from steptwin.host.common.bad_input import apart, prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, toml_table
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
        table.finish()
        make_kinematics(robot)  # only to check kind and dimensions
        _check_speeds(robot)
        return robot


@contextmanager
def _section(table: Table, key: str, *, optional: bool = False) -> Iterator[Table]:
    """Enter the table under a key; a key in it that is not read is an error. A missing optional table is empty."""
    if optional and key not in table:
        yield Table({}, "table")
        return
    with table.section(key) as section:
        yield section
        section.finish()


def _robot(table: Table) -> Robot:
    name, title = table.text("name", empty=False), table.text("title", empty=False)
    with _section(table, "kinematics") as mechanism:
        kind = mechanism.text("kind")
        geometry = {key: mechanism.number(key) for key in mechanism if key != "kind"}
    with _section(table, "board") as settings:
        board = _board(settings)
    with _section(table, "joints") as tables:
        joints = tuple(_joint(tables, key) for key in tables)
    with _section(table, "home") as positions:
        home = tuple(positions.number(joint.name) for joint in joints)
    with _section(table, "outputs", optional=True) as wiring:
        outputs = {key: _output(wiring, key) for key in wiring}
    with _section(table, "places", optional=True) as tables:
        places = {key: _place(tables, key) for key in tables}
    return Robot(name, title, kind, geometry, joints, home, board, outputs, places)


def _output(wiring: Table, name: str) -> Output:
    with _section(wiring, name) as table:
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
    with _section(tables, name) as table:
        unit = table.choice("unit", Unit)
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
    with _section(joint, "switches", optional=True) as table:
        return JointSwitches(
            negative_limit=table.optional("negative_limit", table.number),
            positive_limit=table.optional("positive_limit", table.number),
            home_from=table.optional("home_from", table.number),
            home_to=table.optional("home_to", table.number),
        )


def _homing(joint: Table) -> JointHoming:
    with _section(joint, "homing") as table:
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
