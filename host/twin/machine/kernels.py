"""Give host programs the forms of the firmware's kernel: plain Python, compiled, on an emulated Cortex-M3, and C."""

from collections.abc import Callable

from steptwin.controller.motion.backend import KERNELS as OWN_KERNELS
from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError

__all__ = ["KERNELS", "Kernel", "fastest_kernel", "kernel_files", "kernel_named"]


def _cortex_m3() -> Kernel:
    from steptwin.emulator.cortex_m3.core_kernel import cortex_m3_kernel

    return cortex_m3_kernel()


KERNELS: dict[str, Callable[[], Kernel]] = {**OWN_KERNELS, "cortex-m3": _cortex_m3}
"""The forms of the kernel by name; all make the same edges."""

_MISSING = {
    "numba": "numba is not installed (pip install 'steptwin[fast]')",
    "cortex-m3": "unicorn is not installed (pip install 'steptwin[m3]')",
}


def kernel_named(name: str) -> Kernel:
    """Return a form of the kernel: "python", "numba" or "cortex-m3".

    Raise InputError for another name, or if the extra or the compiler that it needs is not installed.
    """
    from steptwin.emulator.cortex_m3.image import CompilerMissingError

    if name not in KERNELS:
        raise unknown("kernel", name, KERNELS)
    try:
        return KERNELS[name]()
    except ModuleNotFoundError as error:
        raise InputError(f"kernel {name}: {_MISSING[name]}") from error
    except CompilerMissingError as error:
        raise InputError(f"kernel {name}: {error}") from error


def kernel_files() -> dict[str, str]:
    """Return the text of each file of the kernel as C, by its name."""
    from steptwin.emulator.kernel_c.folder import kernel_files as files_in_c

    return files_in_c()
