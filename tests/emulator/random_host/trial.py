"""One session from its seed: random actions, a working move, the judgement, and for some a repetition."""

from dataclasses import dataclass
from functools import cache

from steptwin.controller.motion.backend import KERNELS, Kernel, fastest_kernel
from tests.emulator.random_host.host import RandomHost
from tests.emulator.random_host.machine import repeat
from tests.emulator.random_host.session import Session
from tests.emulator.random_host.working_move import WorkingMove

ACTIONS_MAX = 32
REPEATED = 128
"""Each session whose seed is a multiple of this is repeated on the interpreted kernel."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a session; `fault` is empty if everything held."""

    seed: int
    fault: str
    session: Session
    pulses: int
    frames: int


@cache
def _kernel() -> Kernel:
    return fastest_kernel()


def trial(seed: int) -> Outcome:
    """Execute the session of a seed. Whatever is raised is a fault: firmware and emulator may raise nothing."""
    host = RandomHost(seed, _kernel())
    try:
        host.act(1 + seed % ACTIONS_MAX)
        WorkingMove(host, seed).perform()
        host.end()
        host.machine.close()
        fault = "" if seed % REPEATED else _difference(host)
    except Exception as error:
        fault = f"{type(error).__name__}: {error}"
        host.end()
    pulses = sum(watch.pins.clk.size // 2 for watch in host.machine.axes)
    return Outcome(seed, fault, host.session, pulses, host.machine.bus.frames)


def _difference(host: RandomHost) -> str:
    """Repeat a session from its record on the other kernel, without observers but at the pins."""
    again = repeat(host.session, KERNELS["python"](), watched=False)
    same = again.traces() == host.machine.traces()
    return "" if same else "the interpreted kernel without observers gives other edges, pins or frames"


def fault_of(session: Session) -> str:
    """Execute a recorded session; return what does not hold, or nothing."""
    try:
        repeat(session, _kernel(), watched=True).close()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""
