"""A client of a served board's control port: it operates the emulated machine and reads its state."""

import json
import socket
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from steptwin.host.client.links import ANSWER_S, SILENT, address_text, connected
from steptwin.host.common.choices import Stuck
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.common.processes import ClockStood
from steptwin.host.common.tables import Table, json_table


@dataclass(frozen=True, slots=True)
class Protect:
    """A driver's Protect pin, or its fault output that is wired to the board.

    Attributes:
        low: True while it reports a shutdown of the driver.
        held: True while it is held low externally.
    """

    low: bool
    held: bool


@dataclass(frozen=True, slots=True)
class SwitchState:
    """A limit or home switch.

    Attributes:
        closed: True while it is closed (active).
        stuck: True while it is stuck, independent of the position.
    """

    closed: bool
    stuck: bool


@dataclass(frozen=True, slots=True)
class LatenessReport:
    """Lateness in us of the wall clock: median, 99th percentile and maximum since power-up."""

    late_us_p50: float
    late_us_p99: float
    late_us_max: float


@dataclass(frozen=True, slots=True)
class ControlState:
    """The machine, the bus and the clock of a served board.

    Attributes:
        robot: the robot's name.
        simulated: True if nothing real moves.
        estop: True while the emergency stop is pressed.
        supply_v: voltage of the motor supply.
        temperature_degc: temperature of the board.
        protect: Protect pin of each joint's driver.
        inputs: level of each digital input in the robot file.
        switches: switches of each joint, by their names `-`, `+` and `home`.
        bus_load_percent: load of the bus in the last complete half second.
        bitrate: nominal bit rate of the bus, in bit/s.
        host_bitrate: bit rate of the host's adapter.
        ticks: lateness of servo ticks while an axis moves.
        frames: lateness of the board's frames.
        stood: number and duration of the pauses of the board's clock, caused by a slow computer.
        simulated_s: seconds on the board's clock since power-up.
        wall_s: seconds on the wall clock since power-up.
        document: the complete answer.
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
    bitrate: int
    host_bitrate: int
    ticks: LatenessReport
    frames: LatenessReport
    stood: ClockStood
    simulated_s: float
    wall_s: float
    document: Mapping[str, Any]

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> "ControlState":
        """Decode an answer; raise InputError, which names the key, if it is not a state."""
        table = Table(document, "JSON object")
        with table.section("protect") as joints:
            protect = {name: _protect(joints, name) for name in joints}
        with table.section("inputs") as levels:
            inputs = {name: levels.truth(name) for name in levels}
        with table.section("switches") as joints:
            switches = {name: _switches(joints, name) for name in joints}
        with table.section("bus") as bus:
            load_percent = bus.number("recent_load_percent")
            bitrate, host_bitrate = bus.integer("bitrate"), bus.integer("host_bitrate")
        with table.section("real_time") as real_time:
            ticks, frames = _lateness(real_time, "ticks"), _lateness(real_time, "frames")
            stood = _stood(real_time)
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
            bitrate=bitrate,
            host_bitrate=host_bitrate,
            ticks=ticks,
            frames=frames,
            stood=stood,
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


def _lateness(real_time: Table, what: str) -> LatenessReport:
    with real_time.section(what) as late:
        return LatenessReport(late.number("late_us_p50"), late.number("late_us_p99"), late.number("late_us_max"))


def _stood(real_time: Table) -> ClockStood:
    with real_time.section("stalls") as stalls:
        return ClockStood(stalls.number("count"), stalls.number("total_ms"), stalls.number("longest_ms"))


_ANSWER_MAX_BYTES: Final = 1 << 20
_READ_BYTES: Final = 1 << 16


class ControlClient:
    """Sends one request after the other, from any thread; a context manager that closes the connection.

    It connects at its first request, and again after an error. Each method returns the state of the machine after the
    request. It waits at most 2 s: one to connect and one for the answer.

    Raises:
        InputError: by each method, if the board refuses the request; nothing has changed.
        BusError: by each method, if there is no such port or it does not answer.
    """

    def __init__(self, host: str, port: int) -> None:
        self.title: str = address_text(host, port)
        """HOST:PORT for messages."""
        self._host, self._port = host, port
        self._socket: socket.socket | None = None
        self._asking = threading.Lock()

    def __enter__(self) -> "ControlClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; the next request opens another one."""
        with self._asking:
            self._close()

    # --- requests

    def state(self) -> ControlState:
        """Return the state of the machine."""
        return self.ask("state")

    def emergency_stop(self, *, pressed: bool) -> ControlState:
        """Press or release the emergency stop."""
        return self.ask("estop", pressed=pressed)

    def supply(self, supply_v: float) -> ControlState:
        """Set the voltage of the motor supply, in steps of 10 mV."""
        return self.ask("supply", supply_v=supply_v)

    def temperature(self, temperature_degc: float) -> ControlState:
        """Set the temperature of the board, in steps of 0.1 degC."""
        return self.ask("temperature", temperature_degc=temperature_degc)

    def protect(self, joint: str, *, held: bool) -> ControlState:
        """Hold the Protect pin of a joint's driver low, like a chip that is too hot, or release it."""
        return self.ask("protect", joint=joint, held=held)

    def set_input(self, name: str, *, on: bool) -> ControlState:
        """Set a digital input by its name in the robot file."""
        return self.ask("input", input=name, on=on)

    def switch(self, joint: str, name: str, stuck: Stuck) -> ControlState:
        """Hold a switch of a joint (`-`, `+` or `home`) closed or open, or release it."""
        return self.ask("switch", joint=joint, switch=name, stuck=stuck)

    def node_value(self, node_id: int, place: str) -> float | str | None:
        """Return a value of a further node, such as "0x6000:01"; bytes as hexadecimal digits."""
        return self._of_node("node", node=node_id, object=place)

    def set_node_value(self, node_id: int, place: str, value: float | str) -> float | str | None:
        """Set a value of a further node, as its environment would; return the value after it."""
        return self._of_node("node", node=node_id, object=place, value=value)

    def node_emergency(self, node_id: int, code: int, register: int = 1, data: bytes = b"") -> ControlState:
        """Make a further node send an EMCY; code 0 means that the error is over."""
        return self.ask("node-emergency", node=node_id, code=code, register=register, data=data.hex())

    def switch_node(self, node_id: int, *, on: bool) -> ControlState:
        """Switch the supply of a further node off or on; when switched on, it boots."""
        return self.ask("node-power", node=node_id, on=on)

    def _of_node(self, do: str, **values: Any) -> float | str | None:
        answer = self.ask(do, **values).document.get("node")
        value: float | str | None = answer.get("value") if isinstance(answer, dict) else None
        return value

    def ask(self, do: str, **values: Any) -> ControlState:
        """Send a request with the key `do` and further keys; return the state after it."""
        with self._asking:
            try:
                answer = self._answer({"do": do, **values})
            except OSError as error:
                self._close()
                raise BusError(f"{self.title}: {error.strerror or error}") from error
            except InputError as error:
                self._close()
                raise BusError(f"{self.title}: is not a board's control port: its answer {error}") from error
        if isinstance(answer, str):
            raise InputError(answer)
        return answer

    # --- the connection

    def _answer(self, request: dict[str, Any]) -> ControlState | str:
        """Return the state after a request, or the reason of its refusal.

        Raises:
            OSError: there is no server or no answer.
            InputError: the answer is not one of a control port.
        """
        if self._socket is None:
            self._socket = connected(self._host, self._port, time.monotonic() + ANSWER_S)
        self._socket.settimeout(ANSWER_S)
        self._socket.sendall(json.dumps(request).encode("ascii") + b"\n")
        answer = json_table(self._line(self._socket).decode("utf-8", "replace"))
        return answer.text("error") if "error" in answer else ControlState.of(answer.values)

    def _line(self, sock: socket.socket) -> bytes:
        until_s = time.monotonic() + ANSWER_S
        line = b""
        while not line.endswith(b"\n"):
            sock.settimeout(max(0.001, until_s - time.monotonic()))
            try:
                more = sock.recv(_READ_BYTES)
            except TimeoutError:
                if line:
                    break
                raise TimeoutError(SILENT) from None
            if not more:
                raise ConnectionError("the server has closed the connection")
            line += more
            if len(line) > _ANSWER_MAX_BYTES:
                break
        return line

    def _close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
