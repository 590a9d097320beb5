"""Give the command line the forms of the firmware's kernel: plain Python and compiled, with the same edges."""

from steptwin.controller.backend import KERNELS, Kernel, fastest_kernel

__all__ = ["KERNELS", "Kernel", "fastest_kernel"]
