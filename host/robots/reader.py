"""Reading a robot's TOML file. Every complaint begins with the file and the key, as in `joints.th1.microsteps: ...`."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from reprlib import repr as short
from typing import Final, TypeVar

from steptwin.host.common.bad_input import apart, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.homing import JointHoming, JointSwitches
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import ActiveEdge, Board, Joint, Output, Robot, Transmission, Unit

Choice = TypeVar("Choice", bound=StrEnum)

_LARGEST: Final = 1e9


def parse_robot(text: str, source: str) -> Robot:
    """The robot that a TOML text describes; `source` says in messages where the text comes from.

    Raises:
        InputError: no TOML, a key that is missing, unknown or of the wrong kind, or a value out of range.
    """
    with prefixed(f"{source}: "):
        try:
            table = _Table(tomllib.loads(text))
        except (ValueError, RecursionError) as error:  # also an integer of thousands of digits, arrays within arrays
            raise InputError(f"is not TOML: {error}") from error
        robot = replace(_robot(table), toml=text)
        table.finish()
        make_kinematics(robot)  # for its complaints about kind and dimensions
        _check_speeds(robot)
        return robot


class _Table:
    """A TOML table of which each value is taken once, in its type; whatever is left over then is an error."""

    def __init__(self, values: dict[str, object]) -> None:
        self._values = dict(values)
        self._known: list[str] = []

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(self._values))

    def has(self, key: str) -> bool:
        """Whether a key that may be missing is there."""
        self._known.append(key)
        return key in self._values

    def text(self, key: str) -> str:
        value = self._take(key)
        if not isinstance(value, str) or not value:
            raise InputError(f"{key}: {short(value)} is not a text")
        return value

    def number(self, key: str) -> float:
        value = self._take(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST:
            raise InputError(f"{key}: {short(value)} is not a finite number up to {_LARGEST:g}")
        return float(value)

    def optional_number(self, key: str) -> float | None:
        """None if the key is not there."""
        return self.number(key) if key in self else None

    def integer(self, key: str) -> int:
        value = self._take(key)
        if isinstance(value, bool) or not isinstance(value, int) or abs(value) > _LARGEST:
            raise InputError(f"{key}: {short(value)} is not a whole number up to {_LARGEST:g}")
        return value

    def choice(self, key: str, choices: type[Choice]) -> Choice:
        value = self.text(key)
        if value not in list(choices):
            raise InputError(f"{key}: {value!r} is none of {', '.join(choices)}")
        return choices(value)

    @contextmanager
    def section(self, key: str) -> Iterator["_Table"]:
        """The table under a key; what goes wrong while it is read is said with the key in front."""
        value = self._take(key)
        if not isinstance(value, dict):
            raise InputError(f"{key}: {short(value)} is not a table")
        with prefixed(f"{key}."):
            table = _Table(value)
            yield table
            table.finish()

    @contextmanager
    def optional_section(self, key: str) -> Iterator["_Table"]:
        """Like `section`, empty if the key is not there."""
        self._values.setdefault(key, {})
        with self.section(key) as table:
            yield table

    def __contains__(self, key: str) -> bool:
        """Whether a key is there; it is known from now on."""
        self._known.append(key)
        return key in self._values

    def finish(self) -> None:
        """Complain about the first key that nobody asked for."""
        for key in self._values:
            raise InputError(f"{key}: {unknown('key', key, self._known)}")

    def _take(self, key: str) -> object:
        self._known.append(key)
        if key not in self._values:
            raise InputError(f"{key}: is missing")
        return self._values.pop(key)


def _robot(table: _Table) -> Robot:
    name, title = table.text("name"), table.text("title")
    with table.section("kinematics") as mechanism:
        kind = mechanism.text("kind")
        geometry = {key: mechanism.number(key) for key in mechanism}
    with table.section("board") as settings:
        board = _board(settings)
    with table.section("joints") as tables:
        joints = tuple(_joint(tables, key) for key in tables)
    with table.section("home") as positions:
        home = tuple(positions.number(joint.name) for joint in joints)
    with table.optional_section("outputs") as wiring:
        outputs = {key: _output(wiring, key) for key in wiring}
    with table.optional_section("places") as tables:
        places = {key: _place(tables, key) for key in tables}
    return Robot(name, title, kind, geometry, joints, home, board, outputs, places)


def _output(wiring: _Table, name: str) -> Output:
    with wiring.section(name) as table:
        return Output(joint=table.text("joint"), out=table.integer("out"))


def _place(tables: _Table, name: str) -> dict[str, float]:
    with tables.section(name) as table:
        return {joint: table.number(joint) for joint in table}


def _board(table: _Table) -> Board:
    return Board(
        bitrate=table.integer("bitrate"),
        osc_pf=table.integer("osc_pf") if table.has("osc_pf") else None,
        steplen_ns=table.integer("steplen_ns"),
        stepspace_ns=table.integer("stepspace_ns"),
        dirsetup_ns=table.integer("dirsetup_ns"),
        dirhold_ns=table.integer("dirhold_ns"),
        step_rate_max_hz=table.number("step_rate_max_hz"),
        driver_profile=table.text("driver_profile") if table.has("driver_profile") else None,
        current_a=table.number("current_a") if table.has("current_a") else None,
        active_edge=table.choice("active_edge", ActiveEdge) if table.has("active_edge") else None,
        idle_percent=table.integer("idle_percent") if table.has("idle_percent") else None,
        fast_decay_percent=table.integer("fast_decay_percent") if table.has("fast_decay_percent") else None,
    )


def _joint(tables: _Table, name: str) -> Joint:
    with tables.section(name) as table:
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


def _switches(joint: _Table) -> JointSwitches:
    with joint.optional_section("switches") as table:
        return JointSwitches(
            negative_limit=table.optional_number("negative_limit"),
            positive_limit=table.optional_number("positive_limit"),
            home_from=table.optional_number("home_from"),
            home_to=table.optional_number("home_to"),
        )


def _homing(joint: _Table) -> JointHoming:
    with joint.section("homing") as table:
        return JointHoming(
            method=table.integer("method"),
            search_speed=table.number("search_speed"),
            zero_speed=table.number("zero_speed"),
            acceleration=table.number("acceleration"),
        )


def _transmission(table: _Table, unit: Unit) -> Transmission:
    full_steps_per_rev, microsteps = table.integer("full_steps_per_rev"), table.integer("microsteps")
    if unit is Unit.MM:
        return Transmission(full_steps_per_rev, microsteps, travel_per_turn=table.number("travel_per_turn"))
    return Transmission(full_steps_per_rev, microsteps, travel_per_turn=360.0, ratio=table.number("ratio"))


def _check_speeds(robot: Robot) -> None:
    """A joint whose highest speed its driver cannot follow is a mistake in the file, found before any motion."""
    limit_hz = robot.board.driver_rate_max_hz
    for joint in robot.joints:
        if joint.step_rate_max_hz > limit_hz:
            rate, limit = apart(joint.step_rate_max_hz / 1e3, limit_hz / 1e3)
            raise InputError(
                f"joints.{joint.name}.speed_max: {joint.speed_max:g} {joint.unit}/s takes {rate} kHz of steps,"
                f" more than the driver's {limit} kHz"
            )
