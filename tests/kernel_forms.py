"""The forms of the kernel that tests compare: those of `run --kernel`, and its C on this machine with all checks."""

from collections.abc import Callable
from typing import Final

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import CompilerMissingError
from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.kernels import kernels
from tests.features.kernel_c.native_kernel import native_kernel

FORMS: Final[dict[str, Callable[[], Kernel]]] = {**kernels(), "c": native_kernel}


def kernel_form(name: str) -> Kernel:
    """Return a form of the kernel; skip the test where its extra or compiler is not installed."""
    try:
        return FORMS[name]()
    except (ModuleNotFoundError, CompilerMissingError, InputError) as missing:
        pytest.skip(str(missing))
