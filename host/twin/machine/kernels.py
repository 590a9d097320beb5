"""Forms of the firmware's kernel for host programs: plain Python, compiled, and those of features."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Final

import numpy as np

from steptwin.controller.motion.backend import KERNELS as OWN_KERNELS
from steptwin.controller.motion.backend import Kernel, compiled_kernel, fastest_kernel, python_kernel
from steptwin.controller.motion.kernel import TICKS_PER_MS
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.features import giving
from steptwin.host.planning.plan import Plan
from steptwin.protocol.od import UNITS_PER_FULL_STEP

__all__ = [
    "Kernel",
    "fastest_kernel",
    "kernel_named",
    "kernels",
    "soonest_is_compiled",
    "soonest_kernel",
    "telling_of_compiling",
]


_FAST: Final = "numba"
"""The form of an extra."""


def kernels() -> Mapping[str, Callable[[], Kernel]]:
    """Return functions that create the forms of the kernel, by name; all make the same edges."""
    return dict(OWN_KERNELS) | {name: make for _, given in giving("kernels") for name, make in given().items()}


def kernel_named(name: str) -> Kernel:
    """Return a form of the kernel, such as "python" or "numba".

    Raise InputError for another name, or if a requirement is not installed.
    """
    forms = kernels()
    if name not in forms:
        raise unknown("kernel", name, forms)
    try:
        return forms[name]()
    except ModuleNotFoundError as error:
        if name != _FAST:
            raise
        raise InputError(f"kernel {name}: {name} is not installed ({installing('fast')})") from error


_LOADING_S: Final = 0.4
"""Time to import numba and load the compiled kernel."""
_PLAIN_TICK_S: Final = 0.7e-6
"""Additional time of plain Python for a tick of an axis, against the compiled kernel."""
_PLAIN_STEP_S: Final = 1.5e-6
"""Additional time of plain Python for a step."""


def soonest_kernel(plan: Plan) -> Kernel:
    """Return the kernel with the shortest total time for a plan.

    Plain Python ends a short motion before the compiled kernel is loaded.
    """
    return python_kernel() if _is_short(plan) and not _is_loaded() else fastest_kernel()


def soonest_is_compiled(plan: Plan) -> bool:
    """Return whether `soonest_kernel` returns the compiled one, if numba is installed."""
    return _is_loaded() or not _is_short(plan)


def _is_loaded() -> bool:
    return compiled_kernel.cache_info().currsize > 0


def _is_short(plan: Plan) -> bool:
    ticks = plan.points_units.shape[1] * int(plan.times_ms[-1]) * TICKS_PER_MS
    microsteps = np.array([joint.transmission.microsteps for joint in plan.robot.axes])
    steps = float((np.abs(np.diff(plan.points_units, axis=0)).sum(axis=0) * microsteps).sum()) / UNITS_PER_FULL_STEP
    longer_s: float = ticks * _PLAIN_TICK_S + steps * _PLAIN_STEP_S
    return longer_s < _LOADING_S


@contextmanager
def telling_of_compiling(tell: Callable[[], None], *, wanted: bool = True) -> Iterator[None]:
    """Call `tell` once if numba starts to compile within the block.

    Functions compiled by an earlier process are loaded quickly, without a call. Set `wanted` to False if the block does
    not load numba; otherwise this loads it.
    """
    if not (wanted and find_spec("numba")):
        yield
        return
    from numba.core import event

    class FirstCompiling(event.Listener):
        told = False

        def on_start(self, _event: object) -> None:
            if not self.told:
                self.told = True
                tell()

        def on_end(self, _event: object) -> None: ...

    with event.install_listener("numba:compile", FirstCompiling()):
        yield
