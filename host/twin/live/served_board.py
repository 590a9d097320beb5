"""Serve a robot's board in real time to every program that uses CAN, in a thread of its own or in the caller's.

Other programs reach it at an endpoint: a socketcand server, or a bus of python-can.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import SPEED_MAX, SPEED_MIN
from steptwin.emulator.operations import Operation
from steptwin.host.client.links.bus_link import Connection, check_interface, open_bus
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.common.listening import CHANNEL, LOOPBACK, PORT, is_loopback, listen
from steptwin.host.record.folder import keep_any_run, keep_log, prepare_folder
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.live.control_port import ControlPort
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.host.twin.machine.input_changes import set_input
from steptwin.host.twin.machine.machine_options import MachineKeywords, MachineOptions

if TYPE_CHECKING:
    from steptwin.emulator.live.can_bridge import CanBridge
    from steptwin.emulator.live.socketcand import SocketcandServer


class Endpoint(ABC):
    """A listening socket or a bus of python-can, open from its construction until `close`."""

    kind: ClassVar[str]
    """Key of its figures in the report."""
    title: str
    """Its address, and how to connect."""
    port: int | None = None
    """TCP port of a listening socket."""
    remote: bool = False
    """True if other machines reach a listening socket."""

    @abstractmethod
    def attach(self, loop: LiveLoop) -> None:
        """Connect the endpoint with a live board."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect. An attached endpoint must be closed before its loop."""

    @abstractmethod
    def status(self) -> str:
        """Return the present state as a short text."""

    @abstractmethod
    def figures(self) -> dict[str, Any]:
        """Return the figures for the report."""

    @property
    def failure(self) -> str | None:
        """Why the endpoint has failed; None while it works."""
        return None


class SocketcandEndpoint(Endpoint):
    """A socketcand server, to which any number of clients connect.

    Raises:
        InputError: the host or the port does not exist, or other machines reach the host and `allow_remote` is False.
        BusError: the port is in use.
    """

    kind = "clients"

    def __init__(self, host: str, port: int, *, allow_remote: bool) -> None:
        """Listen at an address of this machine; port 0 takes a free one."""
        self._listener = listen(host, port, allow_remote=allow_remote)
        self._server: SocketcandServer | None = None
        address, port = self._listener.getsockname()[:2]
        self.port: int | None = port
        self.remote: bool = not is_loopback(address)
        self.title: str = (
            f"socketcand at {address}:{self.port}; python-can's tools: "
            f"-i socketcand -c {CHANNEL} --bus-kwargs host={address} port={self.port}"
        )

    def attach(self, loop: LiveLoop) -> None:
        """Accept clients."""
        from steptwin.emulator.live.socketcand import SocketcandServer

        self._server = SocketcandServer(loop, self._listener)

    def close(self) -> None:
        """Disconnect all clients and stop listening."""
        if self._server:
            self._server.close()
        self._listener.close()

    def status(self) -> str:
        """Return the number of clients as text."""
        count = self._server.clients if self._server else 0
        return f"{count} client{'' if count == 1 else 's'}"

    def figures(self) -> dict[str, Any]:
        """Return the numbers of connections served, of those ended by the server, and of frames of another format."""
        server = self._server
        if not server:
            return {}
        return {
            "served": server.served,
            "disconnected": dict(server.disconnected),
            "foreign_frames": server.foreign_frames,
        }


class PythonCanEndpoint(Endpoint):
    """A bus of python-can.

    Raises:
        InputError: python-can does not know the interface.
        BusError: the bus cannot be opened.
    """

    kind = "interface"

    def __init__(self, connection: Connection) -> None:
        """Open the bus."""
        check_interface("interface", connection.interface)
        self._name = connection.title
        self._bus = open_bus(connection)
        self._bridge: CanBridge | None = None
        self.title: str = f"on python-can's interface {self._name}"

    def attach(self, loop: LiveLoop) -> None:
        """Pass frames between the bus and the board."""
        from steptwin.emulator.live.can_bridge import CanBridge

        self._bridge = CanBridge(loop, self._bus)

    def close(self) -> None:
        """Disconnect from the bus."""
        if self._bridge:
            self._bridge.close()
        else:
            self._bus.shutdown()

    def status(self) -> str:
        """Return the bus' name and, if there are any, the number of refused frames."""
        unsent = self._bridge.unsent_frames if self._bridge else 0
        return f"{self._name}, {unsent} frames not sent" if unsent else self._name

    def figures(self) -> dict[str, Any]:
        """Return the bus' name and the numbers of frames of another format, lost at reception and not sent."""
        bridge = self._bridge
        if not bridge:
            return {"name": self._name}
        return {
            "name": self._name,
            "foreign_frames": bridge.foreign_frames,
            "overruns": bridge.overruns,
            "unsent_frames": bridge.unsent_frames,
        }

    @property
    def failure(self) -> str | None:
        """The interface's error message after it has failed; None while it works."""
        failure = self._bridge.failure if self._bridge else None
        return f"{self._name}: {failure}" if failure else None


def open_endpoint(
    host: str | None, port: int | None, interface: str | None, channel: str | None, bitrate: int, *, allow_remote: bool
) -> Endpoint:
    """Listen for socketcand clients, or join the bus of a given python-can interface.

    Raises:
        InputError: the arguments exclude each other, or name no address, port or interface.
        BusError: the port is in use, or the bus cannot be opened.
    """
    if interface is None:
        if channel is not None:
            raise InputError(f"channel={channel}: needs interface=NAME")
        return SocketcandEndpoint(host or LOOPBACK, PORT if port is None else port, allow_remote=allow_remote)
    connection = Connection(interface, channel, bitrate)
    if interface == "socketcand":
        connection = Connection(interface, channel, None, host or LOOPBACK, port or PORT)
    else:
        for name, value in (("host", host), ("port", port)):
            if value is not None:
                raise InputError(f"{name}={value}: is for a socketcand server, not for interface={interface}")
    if allow_remote:
        raise InputError(f"allow_remote=True: is for listening, not for interface={interface}")
    return PythonCanEndpoint(connection)


class ServedBoard:
    """A robot's board, or several, in real time behind a socketcand server or on a bus of python-can.

    As a context manager it runs in a thread of its own until the block ends; `serve_forever` runs it in the caller's
    thread. It can be run once, and its files are complete at its end. An error of writing ends the recording, not the
    board.

    Attributes:
        board: the board with its bus and everything recorded about it.
        endpoint: server or bus for programs.
        control: control port of its machine; None without one.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        host: str | None = None,
        port: int | None = None,
        control_port: int | None = None,
        allow_remote: bool = False,
        interface: str | None = None,
        channel: str | None = None,
        speed: float = 1.0,
        kernel: Kernel | None = None,
        out: Path | str | None = None,
        log: Path | str | None = None,
        replace: bool = False,
        **machine: Unpack[MachineKeywords],
    ) -> None:
        """Set up the board and open its endpoint.

        Args:
            robot: the machine.
            host: address of the socketcand server; by default 127.0.0.1.
            port: TCP port of the server; by default 29536, socketcand's own; 0 takes a free one.
            control_port: TCP port of this machine for programs that press its emergency stop, stick its switches and so
                on (docs/live.md); 0 takes a free one; None: none.
            allow_remote: True to allow an address that other machines reach.
            interface: python-can's name of an interface for the board instead of a server.
            channel: channel of that interface.
            speed: simulated seconds per second.
            kernel: form of the firmware's kernel; by default the fastest one that is installed.
            out: folder for report, edges and bus log.
            log: file for the bus log alone.
            replace: True to replace a run or a recording in `out`, and an older file `log`.
            machine: differences from the robot's file, and operations on the machine: the fields of `MachineOptions`.

        Raises:
            InputError: an argument is out of its range, excludes another one, or would replace existing files.
            BusError: the port is in use, or the bus cannot be opened.
            OSError: a file cannot be written.
        """
        options = MachineOptions(**machine)
        bits_per_s = options.bits_per_s(robot)
        if not SPEED_MIN <= speed <= SPEED_MAX:
            raise InputError(f"speed={speed:g}: is not from {SPEED_MIN:g} to {SPEED_MAX:g}")
        options.joints(robot)
        options.boards_of(robot)
        options.check_features(real_time=True)
        _check_replaced(out, log, replace=replace)
        folder = None if out is None else prepare_folder(out)
        self.endpoint: Endpoint = open_endpoint(host, port, interface, channel, bits_per_s, allow_remote=allow_remote)
        with ExitStack() as on_error:
            on_error.callback(self.endpoint.close)
            self.control: ControlPort | None = None if control_port is None else ControlPort(control_port)
            if self.control:
                on_error.callback(self.control.close)
            self.board: LiveBoard = LiveBoard(
                robot,
                kernel or fastest_kernel(),
                options,
                speed=speed,
                out=folder,
                log=None if log is None else Path(log),
            )
            on_error.pop_all()
        self._loop = LiveLoop(self.board.live)
        self._thread = ThreadPoolExecutor(1, "served board")
        self._final: dict[str, Any] = {}
        """The report when the board has ended."""

    @property
    def port(self) -> int | None:
        """TCP port of the socketcand server; None on a bus of python-can."""
        return self.endpoint.port

    @property
    def title(self) -> str:
        """Address of the board and how to connect, in one line."""
        return self.endpoint.title

    def report(self) -> dict[str, Any]:
        """Return the figures under the keys of report.json (docs/live.md); final when the board has ended."""
        if self._final:
            return self._final
        control = self.control
        return (
            self.board.report()
            | {self.endpoint.kind: self.endpoint.figures()}
            | ({"control": control.figures()} if control else {})
        )

    def __enter__(self) -> "ServedBoard":
        """Run the board in a thread of its own."""
        self._ended = self._thread.submit(self.serve_forever)
        return self

    def __exit__(self, *_: object) -> None:
        """End the board and complete its files; raise what `serve_forever` raises."""
        self.stop()
        self._thread.shutdown()
        self._ended.result()

    def serve_forever(self) -> None:
        """Run the board in this thread until `stop` is called, then complete its files.

        Raises:
            BusError: the bus of python-can has failed, which ends the board, too.
            DeviceFaultError: the user's own firmware has crashed, hangs or has violated its interface.
            RecordingError: a file could not be written; the recording is incomplete.
        """
        with self._loop:
            try:
                self.endpoint.attach(self._loop)
                if self.control:
                    self.control.attach(self._loop, self.board)
                self.call_every(self.board.record_every_s, self.board.record_next)
                self._loop.run()
            except FirmwareError as error:
                raise DeviceFaultError(str(error)) from error
            finally:
                self.endpoint.close()
                if self.control:
                    self.control.close()
        self.board.record()
        self._final = self.report()
        self.board.close(self._final)
        if self.endpoint.failure:
            raise BusError(self.endpoint.failure)
        for failure in self.board.failures:
            raise failure

    def set_input(self, name: str, *, on: bool) -> None:
        """Set a digital input of the machine while the board runs; may be called from any thread.

        Raises:
            InputError: the robot has no input of this name.
        """
        operation = set_input(self.board.robot, name, on=on)
        self.operate(operation)

    def operate(self, operation: Operation) -> None:
        """Execute an operation on the machine with the next turn of the board's loop; from any thread."""
        live, loop = self.board.live, self._loop
        loop.call_soon(lambda: live.call(lambda: self.board.operate(operation), loop.looked_ns))

    def stop(self) -> None:
        """End the board; may be called from any thread and from signal handlers."""
        self._loop.stop()

    def call_every(self, dt_s: float, callback: Callable[[], None]) -> None:
        """Call back every `dt_s` seconds of wall time while the board runs; must be called before it runs."""
        self._loop.call_every(dt_s, callback)


def _check_replaced(out: Path | str | None, log: Path | str | None, *, replace: bool) -> None:
    """Raise InputError if a folder or file would be replaced without permission, or if `replace` has no effect."""
    if replace:
        if out is None and log is None:
            raise InputError("replace=True: is for out=DIR and log=FILE")
        return
    if out is not None:
        keep_any_run(out)
    if log is not None:
        keep_log(log)
