"""A user's own firmware, compiled for this computer, on an emulated board: the C interface and who calls it."""

from importlib.resources import files
from typing import Final

HEADER: Final = "steptwin_firmware.h"
_FILES: Final = (HEADER, "steptwin_hal.h", "steptwin_hal.c", "example.c")


def interface_files() -> dict[str, str]:
    """Return the text of each file by its name: the interface, the hardware layer over it, and an example."""
    folder = files(__name__)
    return {name: (folder / name).read_text(encoding="utf-8") for name in _FILES}
