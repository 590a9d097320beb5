"""List all methods, the kernel first."""

from functools import partial

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.studies.step_methods.austin import austin
from steptwin.host.studies.step_methods.bresenham import bresenham
from steptwin.host.studies.step_methods.dda import dda
from steptwin.host.studies.step_methods.kernel import kernel_method
from steptwin.host.studies.step_methods.pulses import Method

DDA_HZ = (20_000, 40_000, 100_000)


def methods(kernel: Kernel | None = None) -> list[Method]:
    """Return the firmware's kernel (by default the fastest one installed) and the methods in common use."""
    return [
        Method("kernel", "the kernel", partial(kernel_method, kernel or fastest_kernel())),
        *(Method(f"dda-{hz // 1000}k", f"DDA at {hz // 1000} kHz", partial(dda, hz)) for hz in DDA_HZ),
        Method("bresenham", "Bresenham, 10 ms", bresenham),
        Method("austin", "Austin's ramp", austin),
    ]
