"""Give the command line the forms of the firmware's kernel: plain Python, compiled, and on an emulated Cortex-M3."""

from collections.abc import Callable

from steptwin.controller.backend import KERNELS as OWN_KERNELS
from steptwin.controller.backend import Kernel, fastest_kernel

__all__ = ["KERNELS", "Kernel", "KernelMissingError", "fastest_kernel", "kernel_named"]


class KernelMissingError(Exception):
    """A form of the kernel needs something that is not installed; the message says what."""


def _cortex_m3() -> Kernel:
    from steptwin.emulator.cortex_m3.kernel import cortex_m3_kernel

    return cortex_m3_kernel()


KERNELS: dict[str, Callable[[], Kernel]] = {**OWN_KERNELS, "cortex-m3": _cortex_m3}
"""The forms of the kernel by name; all make the same edges."""

_EXTRAS = {"numba": "numba is not installed (pip install 'steptwin[fast]')"}
_EXTRAS["cortex-m3"] = "unicorn is not installed (pip install 'steptwin[m3]')"


def kernel_named(name: str) -> Kernel:
    """Return a form of the kernel; raise KernelMissingError if its extra or its compiler is not installed."""
    from steptwin.emulator.cortex_m3.image import CompilerMissingError

    try:
        return KERNELS[name]()
    except ModuleNotFoundError as error:
        raise KernelMissingError(_EXTRAS[name]) from error
    except CompilerMissingError as error:
        raise KernelMissingError(str(error)) from error
