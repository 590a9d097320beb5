"""A bench board with a machine: an axis whose pulses move a slider past switches, checked tick by tick.

The switches are modelled here independently of the emulator, whose tests compare its switches with these.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, HomingError, Mode, Status
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS, STEP

START, HALT = 0x10, 0x100
FAST_STEPS_PER_S, SLOW_STEPS_PER_S, ACCELERATION_STEPS_PER_S2 = 2_000, 400, 40_000

_TARGET_REACHED = int(Status.TARGET_REACHED)

Closed = Callable[[int], bool]


@dataclass
class Slider:
    """A slider at `position`, in steps, and the switches that are closed at each position."""

    position: int = 0
    switches: dict[DigitalInput, Closed] = field(default_factory=dict)

    def inputs(self) -> int:
        """Return the bits of `DigitalInput` whose switches are closed."""
        return sum(bit for bit, closed in self.switches.items() if closed(self.position))


class HomingBench(BenchBoard):
    """One axis, enabled in homing mode; `wait` advances from servo tick to servo tick."""

    longest_s = 30.0

    def __init__(self, kernel: Kernel, machine: Slider) -> None:
        super().__init__(kernel)
        self.machine = machine
        self.rises: list[tuple[int, int]] = []
        """Instant and sign of every step made."""
        self.edges: list[tuple[int, DigitalInput]] = []
        """Every change of the inputs: the tick at whose start the firmware saw it, in counts, and the levels."""
        self.velocities: list[int] = []
        """The demanded velocity at the start of every tick in which the axis was moving, in 1/64 unit per ms."""
        self._pending: list[tuple[int, int]] = []
        self._levels = 0
        self._dir_level = 0
        self._tick(0)
        self.wait(1)
        self.enable(Mode.HOMING)
        self.write(od.HOMING_SEARCH_SPEED, FAST_STEPS_PER_S * STEP)
        self.write(od.HOMING_ZERO_SPEED, SLOW_STEPS_PER_S * STEP)
        self.write(od.HOMING_ACCELERATION, ACCELERATION_STEPS_PER_S2 * STEP)

    def wait(self, dt_ms: float) -> None:
        until = self.now + round(dt_ms * MS)
        while self.now < until:
            boundary = (self.now // TICK_COUNTS + 1) * TICK_COUNTS
            self._pass_until(min(until, boundary - 1))
            if boundary <= until and (self._tick(boundary) or self._is_due()):
                self._pass_until(boundary)

    def _is_due(self) -> bool:
        """Return whether the firmware has work to do now."""
        due = self.firmware.next_due_counts
        return due is not None and due <= self.now

    def _pass_until(self, until: int) -> None:
        """Let time pass, stopping whenever the firmware has work to do."""
        while True:
            self._advance(until)
            self._fetch()
            due = self.firmware.next_due_counts
            if self.now == until and (due is None or due > until):
                return

    def _tick(self, boundary: int) -> bool:
        """Move the slider by the steps of the tick that has ended, then show its switches to the firmware.

        Return whether they have changed.
        """
        motion = self.firmware.motion
        if motion.axes[0].undrained_pulses or motion.room_ticks < 2:
            self._take_pulses()
        while self._pending and self._pending[0][0] < boundary:
            rise, sign = self._pending.pop(0)
            self.machine.position += sign
            self.rises.append((rise, sign))
        velocity = motion.axes[0].velocity
        if velocity or (self.velocities and self.velocities[-1]):
            self.velocities.append(velocity)
        self.now = boundary
        levels = self.machine.inputs()
        if levels == self._levels:
            return False
        self._levels = levels
        self.edges.append((boundary, DigitalInput(levels)))
        self.firmware.set_inputs([DigitalInput(levels)], boundary)
        self._fetch()
        return True

    def _take_pulses(self) -> None:
        edges = self.firmware.motion.take_edges()[0]
        directions = [(int(word) >> 1, int(word) & 1) for word in edges.direction]
        for rise in map(int, edges.clk_counts[::2]):
            while directions and directions[0][0] <= rise:
                self._dir_level = directions.pop(0)[1]
            self._pending.append((rise, 2 * self._dir_level - 1))
        for _, level in directions:
            self._dir_level = level

    # --- commands and results

    def word(self, bits: int = 0) -> None:
        assert self.write(od.CONTROLWORD, 0x0F | bits) == 0

    def begin(self, method: int, offset_units: int = 0) -> None:
        self.word()
        assert self.write(od.HOMING_METHOD, method) == 0
        assert self.write(od.HOME_OFFSET, offset_units) == 0
        self.word(START)

    def home(self, method: int, offset_units: int = 0, timeout_ms: int = 10_000) -> None:
        """Home, successfully."""
        self.begin(method, offset_units)
        self.end(timeout_ms)
        assert self.bits == (1, 1, 0), self.error

    def end(self, timeout_ms: int = 10_000) -> int:
        """Wait for standstill at the end; return the milliseconds that it took."""
        for ms in range(timeout_ms):
            if self.value(od.STATUSWORD) & _TARGET_REACHED:
                return ms
            self.wait(1)
        raise AssertionError(f"homing has not ended after {timeout_ms} ms")

    @property
    def bits(self) -> tuple[int, int, int]:
        """Target reached, homing attained, homing error: bits 10, 12 and 13."""
        word = self.value(od.STATUSWORD)
        reached, attained = bool(word & Status.TARGET_REACHED), bool(word & Status.HOMING_ATTAINED)
        return int(reached), int(attained), int(bool(word & Status.HOMING_ERROR))

    def strokes(self) -> list[list[int]]:
        """Return one list for each stroke, from standstill to standstill or reversal: its velocities tick by tick."""
        strokes: list[list[int]] = []
        last = 0
        for velocity in self.velocities:
            if velocity and velocity * last <= 0:
                strokes.append([])
            if velocity:
                strokes[-1].append(velocity)
            last = velocity
        return strokes

    @property
    def error(self) -> HomingError:
        return HomingError(self.value(od.HOMING_ERROR))

    @property
    def codes_and_details(self) -> list[tuple[int, int]]:
        """Code and detail of every EMCY sent."""
        return [(int.from_bytes(data[:2], "little"), data[3]) for data in self.frames(0x090)]

    @property
    def zero_steps(self) -> int:
        """The slider's position at which the step counter reads 0."""
        assert self.value(od.POSITION_ACTUAL) % STEP == 0
        return self.machine.position - self.value(od.POSITION_ACTUAL) // STEP
