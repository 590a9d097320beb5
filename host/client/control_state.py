"""How the machine of a served board is, as its control port answers: docs/control-port.md."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from steptwin.host.common.tables import Table


@dataclass(frozen=True, slots=True)
class Protect:
    """A driver's Protect pin.

    Attributes:
        low: True while it is low, for whatever reason: the driver is off.
        held: True while it is held low from outside.
    """

    low: bool
    held: bool


@dataclass(frozen=True, slots=True)
class SwitchState:
    """A limit or home switch.

    Attributes:
        closed: True while it is closed, which is active.
        stuck: True while it sticks as it is, wherever the machine stands.
    """

    closed: bool
    stuck: bool


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late something was seen, in us of the wall clock: median, 99th percentile and maximum since power-up."""

    late_us_p50: float
    late_us_p99: float
    late_us_max: float


@dataclass(frozen=True, slots=True)
class ControlState:
    """The machine, the bus and the clock of a served board.

    Attributes:
        robot: the robot's name.
        simulated: True: nothing real moves.
        estop: True while the emergency stop is pressed.
        supply_v: voltage of the motor supply.
        temperature_degc: of the board.
        protect: each joint's driver.
        inputs: level of each digital input of the robot's file.
        switches: the switches that each joint has, by their names `-`, `+` and `home`.
        bus_load_percent: part of the time in which the bus was busy, over the last whole half second.
        ticks: lateness of servo ticks while an axis moves.
        frames: lateness of the board's frames.
        simulated_s: seconds on the board's clock since power-up.
        wall_s: seconds on the wall clock since power-up.
        document: the whole answer.
    """

    robot: str
    simulated: bool
    estop: bool
    supply_v: float
    temperature_degc: float
    protect: Mapping[str, Protect]
    inputs: Mapping[str, bool]
    switches: Mapping[str, Mapping[str, SwitchState]]
    bus_load_percent: float
    ticks: Lateness
    frames: Lateness
    simulated_s: float
    wall_s: float
    document: Mapping[str, Any]

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> "ControlState":
        """Return the state in an answer; raise InputError, with the key, if the answer is something else."""
        table = Table(document, "JSON object")
        with table.section("protect") as joints:
            protect = {name: _protect(joints, name) for name in joints}
        with table.section("inputs") as levels:
            inputs = {name: levels.truth(name) for name in levels}
        with table.section("switches") as joints:
            switches = {name: _switches(joints, name) for name in joints}
        with table.section("bus") as bus:
            load_percent = bus.number("recent_load_percent")
        with table.section("real_time") as real_time:
            ticks, frames = _lateness(real_time, "ticks"), _lateness(real_time, "frames")
        return cls(
            robot=table.text("robot"),
            simulated=table.truth("simulated"),
            estop=table.truth("estop"),
            supply_v=table.number("supply_v"),
            temperature_degc=table.number("temperature_degc"),
            protect=protect,
            inputs=inputs,
            switches=switches,
            bus_load_percent=load_percent,
            ticks=ticks,
            frames=frames,
            simulated_s=table.number("simulated_s"),
            wall_s=table.number("wall_s"),
            document=document,
        )


def _protect(joints: Table, name: str) -> Protect:
    with joints.section(name) as pin:
        return Protect(pin.truth("low"), pin.truth("held"))


def _switches(joints: Table, joint: str) -> dict[str, SwitchState]:
    with joints.section(joint) as switches:
        return {name: _switch(switches, name) for name in switches}


def _switch(switches: Table, name: str) -> SwitchState:
    with switches.section(name) as switch:
        return SwitchState(switch.truth("closed"), switch.truth("stuck"))


def _lateness(real_time: Table, what: str) -> Lateness:
    with real_time.section(what) as late:
        return Lateness(late.number("late_us_p50"), late.number("late_us_p99"), late.number("late_us_max"))
