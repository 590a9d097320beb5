"""Give host programs the forms of the firmware's kernel: plain Python, compiled, on an emulated Cortex-M3, and C."""

from collections.abc import Callable, Iterator
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
from steptwin.host.planning.plan import Plan
from steptwin.protocol.od import UNITS_PER_FULL_STEP

__all__ = [
    "KERNELS",
    "Kernel",
    "fastest_kernel",
    "kernel_named",
    "soonest_is_compiled",
    "soonest_kernel",
    "telling_of_compiling",
]


def _cortex_m3() -> Kernel:
    from steptwin.features.kernel_c.core_kernel import cortex_m3_kernel

    return cortex_m3_kernel()


KERNELS: dict[str, Callable[[], Kernel]] = {**OWN_KERNELS, "cortex-m3": _cortex_m3}
"""The forms of the kernel by name; all make the same edges."""

_NEEDS = {"numba": ("numba", "fast"), "cortex-m3": ("unicorn", "m3")}
"""The package that a form needs, and the extra that brings it."""


def kernel_named(name: str) -> Kernel:
    """Return a form of the kernel: "python", "numba" or "cortex-m3".

    Raise InputError for another name, or if the extra or the compiler that it needs is not installed.
    """
    from steptwin.features.kernel_c.image import CompilerMissingError

    if name not in KERNELS:
        raise unknown("kernel", name, KERNELS)
    try:
        return KERNELS[name]()
    except ModuleNotFoundError as error:
        package, extra = _NEEDS[name]
        raise InputError(f"kernel {name}: {package} is not installed ({installing(extra)})") from error
    except CompilerMissingError as error:
        raise InputError(f"kernel {name}: {error}") from error


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
