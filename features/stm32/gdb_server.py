"""A small gdbserver for a chip: registers, memory, breakpoints, step, continue, interrupt, detach, kill.

It speaks gdb's remote serial protocol (GDB manual, appendix E) with one client. While the processor is halted, the
whole machine's time stands.
"""

import re
import select
import socket
from collections.abc import Callable, Mapping
from typing import Final

from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.host.common.listening import LOOPBACK, listen

REGISTERS: Final = (*(f"r{number}" for number in range(13)), "sp", "lr", "pc", "xpsr")
_TARGET: Final = (
    '<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd"><target><architecture>arm</architecture>'
    '<feature name="org.gnu.gdb.arm.m-profile">'
    + "".join(
        f'<reg name="{name}" bitsize="32"'
        f"{' type=' + chr(34) + kind + chr(34) if (kind := {'sp': 'data_ptr', 'pc': 'code_ptr'}.get(name)) else ''}/>"
        for name in REGISTERS
    )
    + "</feature></target>"
)
_PACKET_BYTES: Final = 0x1000
_INTERRUPT: Final = b"\x03"
_SIGINT, _SIGTRAP, _SIGSEGV = "S02", "S05", "S0b"
_NO_MEMORY, _NO_ROOM, _NO_PACKET = "E0e", "E1c", "E16"
_RESUME: Final = re.compile(r"(?:vCont;)?([cCsS])")


class GdbServer:
    """Serves one debugger at a port of this machine.

    Attributes:
        port: the TCP port.
    """

    def __init__(self, port: int) -> None:
        """Listen at a port, 0 for a free one; raise InputError or BusError if that is impossible."""
        self._listener = listen(LOOPBACK, port, "gdb")
        self.port = int(self._listener.getsockname()[1])
        self._client: socket.socket | None = None
        self._inbox = b""
        self._acknowledges = True
        self._stop = _SIGTRAP
        """Reply that says why the processor has stopped."""

    def start(self, chip: Stm32Chip) -> None:
        """Wait for a debugger, and serve it while the processor stands at its reset."""
        self._chip = chip
        self._client, _ = self._listener.accept()
        self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        chip.attend_instructions()
        self._serve()

    def close(self) -> None:
        """Disconnect; the process has ended."""
        if self._client is not None:
            self._send("W00")
            self._detach()
        self._listener.close()

    def attend(self) -> None:
        """Serve the debugger if the processor has stopped, or if it is interrupted; see `Debugger`."""
        if self._client is None:
            return
        cells = self._chip.cells
        if cells[c.FAULT]:
            self._stop = _SIGSEGV
        elif cells[c.HALTED]:
            self._stop = _SIGTRAP
        elif self._is_interrupted():
            self._stop = _SIGINT
        else:
            return
        self._send(self._stop)
        self._serve()

    def _is_interrupted(self) -> bool:
        assert self._client is not None
        if select.select([self._client], [], [], 0)[0]:
            data = self._client.recv(_PACKET_BYTES)
            self._inbox += data
            if not data:
                self._detach()
        found = _INTERRUPT in self._inbox
        self._inbox = self._inbox.replace(_INTERRUPT, b"")
        return found

    # --- packets

    def _serve(self) -> None:
        """Answer packets until the processor runs on."""
        while (packet := self._packet()) is not None:
            kind = packet[:1]
            if resumed := _RESUME.match(packet):
                self._resume(steps=resumed[1] in "sS")
                return
            if kind == "k":
                self._detach()
                raise FirmwareError("the debugger has ended the run")
            answer = self._ANSWERS.get(kind)
            try:
                self._send("" if answer is None else answer(self, packet))
            except (ValueError, IndexError):
                self._send(_NO_PACKET)
            if kind == "D":
                break
        self._detach()

    def _packet(self) -> str | None:
        """Return the next packet; None if the debugger has hung up."""
        assert self._client is not None
        while True:
            begin, end = self._inbox.find(b"$"), self._inbox.find(b"#")
            if 0 <= begin < end and len(self._inbox) >= end + 3:
                body, check = self._inbox[begin + 1 : end], self._inbox[end + 1 : end + 3]
                self._inbox = self._inbox[end + 3 :]
                right = check.lower() == b"%02x" % (sum(body) & 0xFF)
                if self._acknowledges:
                    self._client.sendall(b"+" if right else b"-")
                if right:
                    return body.decode("latin-1")
                continue
            try:
                data = self._client.recv(_PACKET_BYTES)
            except OSError:
                data = b""
            if not data:
                return None
            self._inbox += data

    def _send(self, text: str) -> None:
        assert self._client is not None
        body = text.encode("latin-1")
        try:
            self._client.sendall(b"$%b#%02x" % (body, sum(body) & 0xFF))
        except OSError:
            self._detach()

    def _detach(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None
        cells = self._chip.cells
        cells[c.BREAKPOINT_COUNT] = cells[c.STEPPING] = cells[c.HALTED] = 0

    # --- what they ask for

    def _resume(self, *, steps: bool) -> None:
        cells = self._chip.cells
        cells[c.STEPPING] = 1 if steps else 0
        cells[c.STEPS_LEFT] = 1 if steps or self._chip.pc in self._breakpoints() else 0
        cells[c.HALTED] = 0

    def _breakpoints(self) -> list[int]:
        cells = self._chip.cells
        return [cells[c.BREAKPOINT + number] for number in range(cells[c.BREAKPOINT_COUNT])]

    def _query(self, packet: str) -> str:
        if packet.startswith("qSupported"):
            return f"PacketSize={_PACKET_BYTES:x};QStartNoAckMode+;qXfer:features:read+"
        if packet.startswith("qXfer:features:read:target.xml:"):
            begin, size = (int(each, 16) for each in packet.rpartition(":")[2].split(","))
            part = _TARGET[begin : begin + size]
            return ("l" if begin + size >= len(_TARGET) else "m") + part
        return {"qAttached": "1", "qC": "QC1", "qfThreadInfo": "m1", "qsThreadInfo": "l"}.get(packet, "")

    def _set(self, packet: str) -> str:
        if packet != "QStartNoAckMode":
            return ""
        self._acknowledges = False
        return "OK"

    def _register(self, name: str) -> int:
        return self._chip.pc if name == "pc" else self._chip.register(name)

    def _set_register(self, name: str, value: int) -> None:
        if name == "pc":
            self._chip.cells[c.PC] = value & ~1
        else:
            self._chip.set_register(name, value)

    def _read_registers(self, _packet: str) -> str:
        return "".join(self._register(name).to_bytes(4, "little").hex() for name in REGISTERS)

    def _write_registers(self, packet: str) -> str:
        content = bytes.fromhex(packet[1:])
        for number, name in enumerate(REGISTERS[: len(content) // 4]):
            self._set_register(name, int.from_bytes(content[4 * number : 4 * number + 4], "little"))
        return "OK"

    def _read_register(self, packet: str) -> str:
        number = int(packet[1:], 16)
        return self._register(REGISTERS[number]).to_bytes(4, "little").hex() if number < len(REGISTERS) else "E01"

    def _write_register(self, packet: str) -> str:
        number, _, value = packet[1:].partition("=")
        if int(number, 16) >= len(REGISTERS):
            return "E01"
        self._set_register(REGISTERS[int(number, 16)], int.from_bytes(bytes.fromhex(value), "little"))
        return "OK"

    def _read_memory(self, packet: str) -> str:
        address, size = (int(each, 16) for each in packet[1:].split(","))
        content = self._chip.memory(address, min(size, _PACKET_BYTES // 2))
        return _NO_MEMORY if content is None else content.hex()

    def _write_memory(self, packet: str) -> str:
        place, _, content = packet[1:].partition(":")
        return "OK" if self._chip.set_memory(int(place.split(",")[0], 16), bytes.fromhex(content)) else _NO_MEMORY

    def _breakpoint(self, packet: str) -> str:
        """Set or clear a breakpoint; software and hardware ones are the same here."""
        if packet[1:2] not in ("0", "1"):
            return ""
        address, chosen = int(packet.split(",")[1], 16), self._breakpoints()
        if packet[0] == "Z":
            chosen = [*chosen, *([address] if address not in chosen else [])]
        else:
            chosen = [each for each in chosen if each != address]
        if len(chosen) > c.BREAKPOINTS:
            return _NO_ROOM
        for number, each in enumerate(chosen):
            self._chip.cells[c.BREAKPOINT + number] = each
        self._chip.cells[c.BREAKPOINT_COUNT] = len(chosen)
        return "OK"

    def _continuations(self, packet: str) -> str:
        return "vCont;c;C;s;S" if packet == "vCont?" else ""

    def _ok(self, _packet: str) -> str:
        return "OK"

    def _why(self, _packet: str) -> str:
        return self._stop

    _ANSWERS: Final[Mapping[str, Callable[["GdbServer", str], str]]] = {
        "?": _why,
        "q": _query,
        "Q": _set,
        "H": _ok,
        "T": _ok,
        "D": _ok,
        "g": _read_registers,
        "G": _write_registers,
        "p": _read_register,
        "P": _write_register,
        "m": _read_memory,
        "M": _write_memory,
        "Z": _breakpoint,
        "z": _breakpoint,
        "v": _continuations,
    }
    """What answers a packet, by its first character; others are answered as unknown."""
