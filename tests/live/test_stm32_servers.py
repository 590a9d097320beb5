"""An image's servers: a debugger by our own client and by gdb, and USART1 at a TCP port and a terminal."""

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from types import TracebackType

import pytest

from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.stm32.gdb_server import GdbServer
from steptwin.features.stm32.image import read_image
from steptwin.features.stm32.options import Stm32Options
from steptwin.features.stm32.part import ImagePart
from steptwin.features.stm32.running import ImageRun, RunPlan, run_image
from steptwin.host.common.errors import InputError
from steptwin.host.twin.live.served_board import ServedBoard
from tests.features.stm32.examples import EXAMPLES, ROBOT, example_robot

_TIMEOUT_S = 60.0
_IMAGE = EXAMPLES / "compare_stepper.elf"
_SIZE = {name: read_image(_IMAGE).address_of(name) for name in ("reset", "main", "tim2", "move_to")}


class GdbClient:
    """The side of gdb in its remote protocol."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=_TIMEOUT_S)
        self._inbox = b""

    def __enter__(self) -> "GdbClient":
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._socket.close()

    def send(self, text: str) -> None:
        body = text.encode()
        self._socket.sendall(b"$%b#%02x" % (body, sum(body) & 0xFF))

    def interrupt(self) -> None:
        self._socket.sendall(b"\x03")

    def answer(self) -> str:
        """Return the next packet, and acknowledge it."""
        while b"#" not in self._inbox[:-2]:
            data = self._socket.recv(4096)
            assert data, "the server has hung up"
            self._inbox += data
        packet, _, rest = self._inbox.partition(b"#")
        self._inbox = rest[2:]
        body = packet.partition(b"$")[2]
        assert int(rest[:2], 16) == sum(body) & 0xFF
        self._socket.sendall(b"+")
        return body.decode()

    def ask(self, text: str) -> str:
        self.send(text)
        return self.answer()

    def register(self, number: int) -> int:
        return int.from_bytes(bytes.fromhex(self.ask(f"p{number:x}")), "little")


class Debugged:
    """An image that runs in a thread for a debugger."""

    def __init__(self, for_s: float = 0.01) -> None:
        self.server = GdbServer(0)
        self.run: ImageRun | None = None
        self.error: Exception | None = None

        def work() -> None:
            try:
                plan = RunPlan(for_s=for_s, compiled=False, debugger=self.server)
                self.run = run_image(_IMAGE, example_robot(), plan)
            except (InputError, FirmwareError) as error:
                self.error = error

        self.thread = Thread(target=work)
        self.thread.start()

    def ended(self) -> ImageRun:
        self.thread.join(_TIMEOUT_S)
        assert self.error is None
        assert self.run is not None
        return self.run


@pytest.fixture
def debugged() -> Iterator[tuple[Debugged, GdbClient]]:
    """Return a run that waits at its reset, and its debugger."""
    run = Debugged()
    with GdbClient(run.server.port) as client:
        yield run, client
    run.thread.join(_TIMEOUT_S)


def test_a_debugger_reads_and_writes_registers_and_memory(debugged: tuple[Debugged, GdbClient]) -> None:
    run, gdb = debugged
    assert "qXfer:features:read+" in gdb.ask("qSupported:multiprocess+")
    assert gdb.ask("qXfer:features:read:target.xml:0,fff").startswith('l<?xml version="1.0"?>')
    assert gdb.ask("?") == "S05"
    assert gdb.register(15) == _SIZE["reset"]
    assert gdb.register(13) == 0x20005000
    assert gdb.ask("P3=78563412") == "OK"
    assert gdb.ask("g")[8 * 3 : 8 * 4] == "78563412"
    assert gdb.ask("M20000010,4:01020304") == "OK"
    assert gdb.ask("m20000010,4") == "01020304"
    assert gdb.ask("m40000000,4") == "E0e"
    assert gdb.ask("m8000000,4") == "00500020"
    assert gdb.ask("mzz,4") == "E16"
    assert gdb.ask("vMustReplyEmpty") == ""
    assert gdb.ask("D") == "OK"
    assert run.ended().sent == {"USART1": "ready\n"}


def test_a_debugger_stops_at_breakpoints_and_steps(debugged: tuple[Debugged, GdbClient]) -> None:
    run, gdb = debugged
    assert gdb.ask(f"Z0,{_SIZE['tim2']:x},2") == "OK"
    for _ in range(3):
        assert gdb.ask("c") == "S05"
        assert gdb.register(15) == _SIZE["tim2"]
        assert gdb.register(16) & 0x1FF == 16 + 28
    assert gdb.ask("s") == "S05"
    assert gdb.register(15) in (_SIZE["tim2"] + 2, _SIZE["tim2"] + 4)
    assert gdb.ask(f"z0,{_SIZE['tim2']:x},2") == "OK"
    gdb.send("c")
    assert gdb.answer() == "W00"
    stopped = run.ended()
    undisturbed = run_image(_IMAGE, example_robot(), RunPlan(for_s=0.01, compiled=False))
    assert [axis.steps for axis in stopped.axes] == [axis.steps for axis in undisturbed.axes]


def test_a_debugger_interrupts_and_kills() -> None:
    run = Debugged(for_s=100.0)
    with GdbClient(run.server.port) as gdb:
        gdb.send("c")
        gdb.interrupt()
        assert gdb.answer() == "S02"
        assert gdb.register(15) > 0x08000000
        gdb.send("k")
        assert run.ended().reasons[0] == "the debugger has ended the run"


@pytest.mark.skipif(shutil.which("gdb-multiarch") is None, reason="needs gdb-multiarch")
def test_gdb_itself(tmp_path: Path) -> None:
    run = Debugged()
    words = [
        f"target remote :{run.server.port}",
        "break move_to",
        "continue",
        "backtrace",
        "info registers pc",
        "detach",
    ]
    commands = [word for each in words for word in ("-ex", each)]
    told = subprocess.run(
        ["gdb-multiarch", "-nx", "-batch", *commands, str(_IMAGE)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=_TIMEOUT_S,
        check=True,
    ).stdout
    assert "move_to (" in told
    assert "main () at" in told
    run.ended()


def _read_until(read: "socket.socket | int", text: bytes) -> bytes:
    found = b""
    while text not in found:
        data = os.read(read, 100) if isinstance(read, int) else read.recv(100)
        assert data
        found += data
    return found


def test_a_sender_reaches_usart1_at_a_port_and_at_a_terminal() -> None:
    image = Stm32Options(image=EXAMPLES / "gcode_stepper.elf", uart_port=0)
    fitted = image.fitted(example_robot(), EXAMPLES, compiled=False)
    served = ServedBoard(example_robot(), port=0, speed=0.02, extras=[fitted])
    part = served.board.parts["stm32"]
    assert isinstance(part, ImagePart)
    (line,) = part.described()
    address, _, terminal = line.removeprefix("USART1 at tcp://").partition(", and the terminal ")
    with served, socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2])), timeout=_TIMEOUT_S) as tcp:
        while "ready" not in part.tools(lambda _: None).uart.text:  # what comes before is lost, as on a board
            time.sleep(0.01)
        tcp.sendall(b"G0 X20 Y-4\n")
        assert _read_until(tcp, b"ok\n").endswith(b"ok\n")
        if terminal:
            opened = os.open(terminal, os.O_RDWR | os.O_NOCTTY)
            os.write(opened, b"M114\n")
            assert b"X20 Y-4\nok\n" in _read_until(opened, b"Y-4\nok\n")
            os.close(opened)
    report = served.report()
    assert [axis["steps_end"] for axis in report["axes"]] == [20, -4]


def test_serve_takes_an_image() -> None:
    words = [
        *(sys.executable, "-m", "steptwin", "serve", "--robot-file", str(ROBOT), "--port", "0", "--uart-port", "0"),
        *("--image", str(EXAMPLES / "compare_stepper.elf")),
    ]
    lines = []
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            if line.startswith("Ctrl-C"):
                break
        process.terminate()
    assert any(line.startswith("USART1 at tcp://127.0.0.1:") for line in lines)
