"""A firmware without bus or driver: tests send frames and read its answers at chosen instants."""

import struct

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.firmware import Firmware
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State, Status
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import Frame
from steptwin.protocol.object_view import ObjectView
from steptwin.protocol.pvt import PvtRecord
from tests.controller.units import MS

_CALLS_AT_ONCE_MAX = 1000
"""Calls of the firmware in the same instant from which on it counts as hanging."""


class BenchBoard:
    """Talks to a firmware directly; `sent` collects its frames, with their instants.

    A firmware that hangs fails its test: it leaves work undone that is due, or its test waits for longer than
    `longest_s` of virtual time.
    """

    longest_s = 200.0

    def __init__(self, kernel: Kernel, axes: int = 1, view: ObjectView | None = None, microsteps: int = 16) -> None:
        flash = [FlashPage({od.MICROSTEPS: microsteps}) for _ in range(axes)] if microsteps != 16 else None
        self.firmware = Firmware(kernel, axes, flash, view=view)
        self.now = 0
        self._calls_at_once = 0
        self.sent: list[tuple[int, Frame]] = []
        self.inputs = [DigitalInput(0)] * axes
        self.firmware.boot(0)
        self._fetch()

    def _fetch(self) -> None:
        while frame := self.firmware.transmit.take((), 0, self.now):
            self.sent.append((self.now, frame))

    def wait(self, dt_ms: float) -> None:
        """Let time pass, stopping whenever the firmware has work to do."""
        until = self.now + round(dt_ms * MS)
        while self.now < until:
            self._advance(until)
            if self.firmware.motion.room_ticks == 0:
                self.firmware.motion.take_edges()
            self._fetch()

    def _advance(self, until: int) -> None:
        """Let time pass up to an instant, or until the firmware has work to do, and let it do that."""
        before, due = self.now, self.firmware.next_due_counts
        self.now = self.firmware.advance(until if due is None else max(self.now, min(until, due)))
        self.firmware.poll(self.now)
        self._calls_at_once = self._calls_at_once + 1 if self.now == before else 0
        assert self._calls_at_once < _CALLS_AT_ONCE_MAX, f"the firmware leaves undone what is due at {due} counts"
        assert self.now < self.longest_s * 1000 * MS, f"the test waits for longer than {self.longest_s:g} s"

    def send(self, cob_id: int, data: bytes) -> None:
        """Deliver a frame now."""
        self.firmware.receive(Frame(cob_id, data), self.now)
        self.firmware.poll(self.now)
        self._fetch()

    def set_inputs(self, levels: DigitalInput, *axes: int) -> None:
        """Set the inputs of these axes, or of all."""
        for axis in axes or range(len(self.inputs)):
            self.inputs[axis] = levels
        self.firmware.set_inputs(self.inputs, self.now)
        self.firmware.poll(self.now)
        self._fetch()

    def measure(self, supply_10mv: int = 2400, temperature_decidegc: int = 250) -> None:
        """Set the readings of the board's analogue inputs."""
        self.firmware.measure(supply_10mv, temperature_decidegc, self.now)
        self.firmware.poll(self.now)
        self._fetch()

    def state(self, axis: int = 0) -> State:
        """Return the state of an axis' drive."""
        return self.firmware.nodes[axis].drive.state

    def flags(self, axis: int = 0) -> int:
        """Return the flags of the PVT status (2012h:03)."""
        return self.value(od.PVT_FLAGS, axis)

    def has(self, bit: Status, axis: int = 0) -> bool:
        """Return whether a bit of the statusword is set."""
        return bool(self.value(od.STATUSWORD, axis) & bit)

    def emergencies(self, axis: int = 0) -> list[int]:
        """Return the error codes that an axis has reported by EMCY; 0 is the end of an error."""
        frames = self.frames(0x080 + self.firmware.nodes[axis].node_id)
        return [int.from_bytes(data[:2], "little") for data in frames if data]

    def errors(self, axis: int = 0) -> list[int]:
        """Return the error codes that an axis has reported by EMCY, without the ends of errors."""
        return [code for code in self.emergencies(axis) if code]

    def nmt(self, command: int, node: int = 0) -> None:
        self.send(0, bytes((command, node)))

    def write(self, address: int, value: int, axis: int = 0) -> int:
        """Write by SDO; return the abort code, 0 for success."""
        node = self.firmware.nodes[axis]
        entry = node.dictionary.entries[address]
        size = entry.data_type.size
        data = value.to_bytes(size, "little", signed=value < 0)
        request = struct.pack("<BHB", 0x23 | (4 - size) << 2, *od.index_and_subindex(address)) + data.ljust(4, b"\0")
        self.send(0x600 + node.node_id, request)
        answer = self.last(0x580 + node.node_id)
        return int.from_bytes(answer[4:], "little") if answer[0] == 0x80 else 0

    def read(self, address: int, axis: int = 0) -> int:
        """Read a number by SDO, of a quantity in user units; fail if the node refuses it."""
        node = self.firmware.nodes[axis]
        self.send(0x600 + node.node_id, struct.pack("<BHBI", 0x40, *od.index_and_subindex(address), 0))
        answer, data_type = self.last(0x580 + node.node_id), node.dictionary.entries[address].data_type
        assert answer[0] != 0x80, f"{od.place_text(address)}: {answer.hex()}"
        return int.from_bytes(answer[4 : 4 + data_type.size], "little", signed=data_type.signed)

    def value(self, address: int, axis: int = 0) -> int:
        """Return the present value of an entry, of a quantity in wire units."""
        return self.firmware.nodes[axis].dictionary.get(address)

    def frames(self, cob_id: int) -> list[bytes]:
        """Return the data of all frames sent with a COB-ID."""
        return [frame.data for _, frame in self.sent if frame.cob_id == cob_id]

    def last(self, cob_id: int) -> bytes:
        """Return the data of the last frame sent with a COB-ID; raise StopIteration if there is none."""
        return next(frame.data for _, frame in reversed(self.sent) if frame.cob_id == cob_id)

    def enable(self, mode: int = 7) -> None:
        """Bring every axis to OPERATION ENABLED in a mode."""
        self.nmt(1)
        for axis in range(len(self.firmware.nodes)):
            for word in (0x06, 0x07, 0x0F):
                assert self.write(od.CONTROLWORD, word, axis) == 0
            assert self.write(od.MODE_OF_OPERATION, mode, axis) == 0

    def record(self, displacement: int, velocity: int, duration_ms: int, sequence: int, axis: int = 0) -> None:
        """Send a PVT record by RPDO4."""
        data = PvtRecord(displacement, velocity, duration_ms, sequence).encode()
        self.send(0x500 + self.firmware.nodes[axis].node_id, data)

    def start(self) -> None:
        """Set the start bit of every axis by RPDO2 and SYNC."""
        for node in self.firmware.nodes:
            self.send(0x300 + node.node_id, b"\x1f\x00")
        self.send(0x080, b"")
