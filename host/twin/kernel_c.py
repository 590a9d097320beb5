"""Give the command line the firmware's kernel as C."""

from steptwin.emulator.kernel_c.folder import kernel_files

__all__ = ["kernel_files"]
