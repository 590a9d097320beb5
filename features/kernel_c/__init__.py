"""The motion kernel in C11, and the same kernel on an emulated Cortex-M3."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

if TYPE_CHECKING:
    from steptwin.controller.motion.backend import Kernel


def _cortex_m3() -> "Kernel":
    from steptwin.features.kernel_c.image import CompilerMissingError
    from steptwin.host.common.errors import InputError
    from steptwin.host.common.extras import installing

    try:
        from steptwin.features.kernel_c.core_kernel import cortex_m3_kernel

        return cortex_m3_kernel()
    except ModuleNotFoundError as error:
        raise InputError(f"kernel cortex-m3: unicorn is not installed ({installing('m3')})") from error
    except CompilerMissingError as error:
        raise InputError(f"kernel cortex-m3: {error}") from error


def _kernels() -> "Mapping[str, Callable[[], Kernel]]":
    return {"cortex-m3": _cortex_m3}


FEATURE: Final = Feature(
    name="kernel_c",
    kernels=_kernels,
    commands=(
        CommandRow(
            "kernel-c",
            COMMAND_GROUPS[3],
            "Write the firmware's motion kernel as C11: header, source, an example and a README with units and limits.",
            "steptwin.features.kernel_c.command",
            usual=False,
        ),
    ),
)
