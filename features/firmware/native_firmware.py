"""A user's firmware as a board's program: call the library's functions and check their results."""

from collections.abc import Sequence
from pathlib import Path
from struct import iter_unpack, pack
from typing import TYPE_CHECKING, Final

from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.firmware.library import FRAME_BYTES, NEVER
from steptwin.features.firmware.process import FirmwareProcess
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

if TYPE_CHECKING:
    from collections.abc import Collection

    from steptwin.emulator.board.board import Board

_AHEAD_COUNTS: Final = COUNTS_PER_MS // 40
"""Time that the firmware runs ahead at once to complete a pulse for its driver."""
PINS: Final = ("STEP", "DIR", *Pin)
"""Pins in the order of `enum st_pin`."""
_STEP, _DIR = 0, 1
_ID_MAX: Final = 0x7FF
_DATA_MAX: Final = 8
_WORK_MAX: Final = 1000
"""Largest number of calls and frames within a millisecond; the fastest bus carries 21 frames in one."""
_WAITING_MAX: Final = 1000
"""Largest number of frames that wait for a mailbox; further ones are lost."""
_SLICE_COUNTS: Final = 100 * COUNTS_PER_MS
"""Longest time of one call of the library, which limits the time to detect a hang."""
_REST_COUNTS: Final = 20 * COUNTS_PER_MS
"""Time without an edge after which an axis counts as at rest; it is then searched for its next edge tick by tick."""


class NativePulses:
    """Edges of one axis that have not been fetched."""

    def __init__(self) -> None:
        self.running = False
        self.undrained_pulses: int = 0
        self.moved_counts = self.stepped_counts = 0
        """Instants of its last edge, and of its last edge of STEP."""
        self.levels: list[int] = [0] * len(PINS)
        self.clk: list[int] = []
        self.direction: list[int] = []

    def quiet_ticks(self, steps: int) -> int:  # noqa: ARG002  (nobody knows what a user's firmware is about to do)
        """Return 0: only the driver's fastest rate bounds the steps."""
        return 0

    def take_edges(self) -> PinEdges:
        """Return the edges; the last pulse may not have ended."""
        edges = PinEdges(self.clk, self.direction)
        self.clk, self.direction, self.undrained_pulses = [], [], 0
        return edges


class NativeMotion:
    """Edges of all axes, and the instant up to which they are known."""

    def __init__(self, axis_count: int) -> None:
        self.axes: tuple[NativePulses, ...] = tuple(NativePulses() for _ in range(axis_count))
        self.reached_counts = 0
        self.starts: int = 0
        self.running_axes: set[int] = set()
        self.room_ticks = 1 << 30
        self.events: tuple[()] = ()

    @property
    def tick(self) -> int:
        """First servo tick that is not known completely."""
        return (self.reached_counts + 1) // TICK_COUNTS

    def take_edges(self) -> Sequence[PinEdges]:
        """Return the edges of all axes."""
        return [axis.take_edges() for axis in self.axes]

    def note(self, number: int) -> None:
        """Register an axis with a moved pin."""
        if number not in self.running_axes:
            self.running_axes.add(number)
            self.axes[number].running = True
            self.starts += 1

    def let_rest(self) -> None:
        """Mark axes without recent edges as at rest."""
        for number in list(self.running_axes):
            axis = self.axes[number]
            if self.reached_counts - axis.moved_counts > _REST_COUNTS:
                self.running_axes.discard(number)
                axis.running = False

    def begins_pulse(self, pulse_counts: int) -> bool:
        """Return True while an axis' STEP is high, for less than this time."""
        since_counts = self.reached_counts - pulse_counts
        return any(axis.levels[_STEP] and axis.stepped_counts > since_counts for axis in self.axes)

    @property
    def resting(self) -> int:
        """Axes at rest, as bits."""
        return sum(1 << number for number in range(len(self.axes)) if number not in self.running_axes)


class NativeFrames:
    """Frames that wait for a mailbox, in order."""

    def __init__(self) -> None:
        self.services: list[Frame] = []
        self.process_data: tuple[()] = ()
        self.due_counts: int | None = None

    def take(self, mailboxes: "Collection[Frame]", idle_since_counts: int, now_counts: int) -> Frame | None:  # noqa: ARG002
        """Return the oldest frame, unless a mailbox has its identifier."""
        if not self.services or any(frame.cob_id == self.services[0].cob_id for frame in mailboxes):
            return None
        return self.services.pop(0)


class NativeFirmware:
    """A user's firmware between two power-ups, in a process of its own."""

    def __init__(self, path: Path, board: "Board", flash: bytes) -> None:
        """Prepare it for a board; its process begins with `boot`."""
        self._path, self._node, self._flash = path, board.config.first_node_id, flash
        self._drivers = board.drivers
        self._process: FirmwareProcess | None = None
        self.motion: NativeMotion = NativeMotion(board.config.axis_count)
        self.transmit: NativeFrames = NativeFrames()
        self._booting = False
        self._work = self._work_ms = 0
        """Calls and frames within a millisecond, and the number of that millisecond."""
        self.pins: list[PinChange] = []
        self.due_counts: int | None = None

    @property
    def next_due_counts(self) -> int | None:
        """Next instant when a frame may leave."""
        return self.due_counts

    def end(self) -> bytes:
        """End the process, if it has started; return the flash content."""
        if self._process is not None and self._process.close.alive:
            self._flash = self._process.flash()
            self._process.close()
        return self._flash

    # --- in

    def boot(self, now_counts: int) -> None:
        """Power up."""
        self._process = FirmwareProcess(self._path)
        self.motion.reached_counts = now_counts
        self._booting = True
        self._call("boot", now_counts, len(self.motion.axes), self._node, self._flash, now_counts)
        self._booting = False
        self._lengthen_pulses()

    def receive(self, frame: Frame, now_counts: int) -> None:
        """Pass a frame from the bus to the firmware."""
        now_counts = max(now_counts, self.motion.reached_counts)
        packed = pack("<IB3x8s", frame.cob_id, len(frame.data), bytes(frame.data))
        self._call("receive", now_counts, packed, now_counts)
        self._lengthen_pulses()

    def hears(self, cob_id: int) -> bool:  # noqa: ARG002  (what a user's filter passes is not known)
        """Return True: there is no filter."""
        return True

    def on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Do nothing: the interface has no controller errors."""

    def on_bus_off(self, now_counts: int) -> None:
        """Do nothing: the interface has no bus-off."""

    def set_inputs(self, inputs: Sequence[DigitalInput], now_counts: int) -> None:
        """Set the levels of all inputs."""
        now_counts = max(now_counts, self.motion.reached_counts)
        self._call("inputs", now_counts, pack(f"<{len(inputs)}I", *inputs), now_counts)
        self._lengthen_pulses()

    def measure(self, supply_10mv: int, temperature_decidegc: int, now_counts: int) -> None:
        """Do nothing: the interface has no analogue inputs."""

    # --- time forward

    def advance(self, until_counts: int) -> int:
        """Let time pass up to an instant, or until frames wait or an axis starts; return the instant reached."""
        motion = self.motion
        if self._process is None:
            motion.reached_counts = max(motion.reached_counts, until_counts)
        while motion.reached_counts < until_counts:
            starts = motion.starts
            if self._run(min(until_counts, motion.reached_counts + _SLICE_COUNTS)) or motion.starts != starts:
                break
        self._lengthen_pulses()
        return min(motion.reached_counts, until_counts)

    def _lengthen_pulses(self) -> None:
        """Run ahead until each pulse has ended or is long enough to count; drivers get only such pulses."""
        pulse_counts = self._drivers.pulse_min_counts
        while self._process is not None and self.motion.begins_pulse(pulse_counts):
            self._run(self.motion.reached_counts + _AHEAD_COUNTS)

    def poll(self, now_counts: int) -> None:
        """Do due work."""
        if self._process is not None and self._is_due(now_counts):
            self._run(now_counts)
            self._lengthen_pulses()
            if self._is_due(now_counts) and not self.transmit.services:
                raise self._broken("st_next_due", "names an instant that has passed", now_counts)

    def _is_due(self, now_counts: int) -> bool:
        return self.due_counts is not None and self.due_counts <= now_counts

    def _run(self, until_counts: int) -> bool:
        """Let time pass; return whether there are frames."""
        before, waiting = self.motion.reached_counts, len(self.transmit.services)
        until_counts = max(until_counts, before)
        edges = self._call("run", until_counts, until_counts, self.motion.resting)
        came = len(self.transmit.services) > waiting
        if self.motion.reached_counts == before < until_counts and not came and not edges:
            raise self._broken("st_run", "stands still", before)
        self.motion.let_rest()
        return came

    # --- out

    def take_pins(self) -> list[PinChange]:
        """Return the pin changes since the last call."""
        pins, self.pins = self.pins, []
        return pins

    def _call(self, name: str, until_counts: int, *arguments: object) -> int:
        """Call the library for all axes up to an instant; return the number of edges."""
        assert self._process
        reached, due, edges, frames = self._process.call(name, *arguments)
        before = self.motion.reached_counts
        if not before <= reached <= until_counts:
            back = "went back in time" if reached < before else f"ran beyond {until_counts / COUNTS_PER_SECOND:.9f} s"
            raise self._broken(f"st_{name}", f"{back}: it returned", reached)
        self.motion.reached_counts = reached
        self._count_work(f"st_{name}", reached, 1 + len(frames) // FRAME_BYTES)
        self.due_counts = None if due == NEVER else due
        for edge in iter_unpack("<QHBBI", edges):
            self._take_edge(before, *edge[:4])
        for cob_id, length, data in iter_unpack("<IB3x8s", frames):
            if cob_id > _ID_MAX or length > _DATA_MAX:
                raise self._broken("st_take_frames", f"gives a frame 0x{cob_id:X} of {length} bytes", reached)
            if len(self.transmit.services) < _WAITING_MAX:
                self.transmit.services.append(Frame(cob_id, data[:length]))
        return len(edges)

    def _count_work(self, function: str, reached: int, work: int) -> None:
        """Count calls and frames in each millisecond of board time; too many raise an error."""
        now_ms = reached // COUNTS_PER_MS
        self._work = work + (self._work if now_ms == self._work_ms else 0)
        self._work_ms = now_ms
        if self._work > _WORK_MAX:
            raise self._broken(function, f"asks for more than {_WORK_MAX} calls and frames within 1 ms", reached)

    def _take_edge(self, before: int, counts: int, number: int, pin: int, level: int) -> None:
        if number >= len(self.motion.axes) or pin >= len(PINS) or level > 1:
            raise self._broken("st_take_edges", f"gives axis {number}, pin {pin}, level {level}", counts)
        axis = self.motion.axes[number]
        if not max(before, axis.moved_counts if pin <= _DIR else 0) <= counts <= self.motion.reached_counts:
            raise self._broken("st_take_edges", f"gives an edge of {PINS[pin]} out of its time", counts)
        if axis.levels[pin] == level:
            return
        axis.levels[pin] = level
        if pin > _DIR:
            self.pins.append(PinChange(counts, number, Pin(PINS[pin]), level))
            return
        self.motion.note(number)
        axis.moved_counts = counts
        if pin == _STEP and self._booting and self._drivers.begin_high(number, counts):
            axis.stepped_counts = counts
        elif pin == _DIR:
            axis.direction.append(2 * counts + level)
        else:
            axis.undrained_pulses += 1  # the driver may step at either edge
            axis.stepped_counts = max(counts, axis.stepped_counts + 1)  # no instruction takes zero time
            axis.clk.append(axis.stepped_counts)

    def _broken(self, function: str, what: str, counts: int) -> FirmwareError:
        if self._process:
            self._process.close()
        return FirmwareError(f"{self._path}: {function} {what} at {counts / COUNTS_PER_SECOND:.9f} s")


class NativeProgram:
    """A user's library as the program of a board, with the content of its flash."""

    def __init__(self, path: Path) -> None:
        """Use the file of a library."""
        self.path = path
        self.flash: bytes = b""
        self._running: NativeFirmware | None = None

    def start(self, board: "Board") -> NativeFirmware:
        """Return a new firmware; the one before it ends."""
        if self._running is not None:
            self.flash = self._running.end()
        self._running = NativeFirmware(self.path, board, self.flash)
        return self._running

    def connect(self, board: "Board") -> None:
        """Do nothing: it needs nothing of the board."""
