"""A bench board in a profile mode, with that mode's controlwords and handshake."""

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

    def steps(self) -> int:
        """Return the number of CLK rises since the last call."""
        return len(self.firmware.motion.take_edges()[0].clk_counts) // 2

    @property
    def speed_steps_per_s(self) -> float:
        return self.value(od.VELOCITY_ACTUAL) / STEP
