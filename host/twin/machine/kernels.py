"""Give host programs the forms of the firmware's kernel: plain Python, compiled, and those of features."""

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
"""The form that an extra brings."""


def kernels() -> Mapping[str, Callable[[], Kernel]]:
    """Return what makes the forms of the kernel, by name; all make the same edges."""
    return dict(OWN_KERNELS) | {name: make for _, given in giving("kernels") for name, make in given().items()}


def kernel_named(name: str) -> Kernel:
    """Return a form of the kernel, such as "python" or "numba".

    Raise InputError for another name, or if what it needs is not installed.
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
"""Time that a process takes to import numba and load the compiled kernel."""
_PLAIN_TICK_S: Final = 0.7e-6
"""Time that plain Python takes for a tick of an axis longer than the compiled kernel, on the same computer."""
_PLAIN_STEP_S: Final = 1.5e-6
"""Likewise for a step."""


def soonest_kernel(plan: Plan) -> Kernel:
    """Return the kernel with which the run of a plan ends soonest.

    A short motion is over in plain Python before the compiled kernel would be loaded.
    """
    return python_kernel() if _is_short(plan) and not _is_loaded() else fastest_kernel()


def soonest_is_compiled(plan: Plan) -> bool:
    """Return whether `soonest_kernel` returns the compiled one, where numba is installed."""
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
    """Call `tell` once, before it begins, if numba compiles something within the block.

    What an earlier process has compiled is loaded, which is quick and not told. Where the block does not load numba it
    is not `wanted`: to watch numba loads it.
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
