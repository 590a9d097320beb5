"""A bench board in a profile mode, with that mode's controlwords and handshake."""

from typing import Self

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, Status
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

NEW, AT_ONCE, RELATIVE, HALT = 0x10, 0x20, 0x40, 0x100


class ProfileBench(BenchBoard):
    """A bench board with one axis, enabled in a profile mode, and that mode's controlwords."""

    def __init__(self, kernel: Kernel, mode: Mode) -> None:
        super().__init__(kernel)
        self.enable(mode)
        self.write(od.PROFILE_VELOCITY, 4000 * STEP)
        self.write(od.PROFILE_ACCELERATION, 40_000 * STEP)
        self.write(od.PROFILE_DECELERATION, 40_000 * STEP)

    @classmethod
    def with_microsteps(cls, kernel: Kernel, microsteps: int) -> Self:
        """Return one in profile position mode with these microsteps, which may be set only while it is off."""
        board = cls(kernel, Mode.NONE)
        board.write(od.CONTROLWORD, 0)
        board.write(od.MICROSTEPS, microsteps)
        board.enable(Mode.PROFILE_POSITION)
        return board

    def word(self, bits: int = 0) -> None:
        assert self.write(od.CONTROLWORD, 0x0F | bits) == 0

    def set_point(self, target: int, bits: int = 0) -> None:
        """Give a set-point, with its whole handshake."""
        assert self.write(od.TARGET_POSITION, target) == 0
        self.word(NEW | bits)
        assert self.has(Status.SET_POINT_ACKNOWLEDGED)
        self.word(bits & HALT)

    def until(self, bit: Status, timeout_ms: int = 20_000) -> float:
        """Wait for a bit of the statusword; return how long it took in ms."""
        for ms in range(timeout_ms):
            if self.has(bit):
                return ms
            self.wait(1)
        raise AssertionError(f"no {bit!r} in {timeout_ms} ms")

    def ends_at_a_last_target(self) -> None:
        """See that a last set-point at once is obeyed whatever came before, and that there was no emergency."""
        self.write(od.PROFILE_VELOCITY, 10**7)
        self.write(od.PROFILE_ACCELERATION, 10**8)
        self.write(od.TARGET_POSITION, 12_345)
        self.word()
        self.word(NEW | AT_ONCE)
        self.until(Status.TARGET_REACHED)
        assert self.value(od.POSITION_DEMAND) == 12_345
        assert self.frames(0x090) == [], "no emergency"

    def steps(self) -> int:
        """Return the number of CLK rises since the last call."""
        return len(self.firmware.motion.take_edges()[0].clk_counts) // 2

    @property
    def speed_steps_per_s(self) -> float:
        return self.value(od.VELOCITY_ACTUAL) / STEP
