"""The motion kernel once more, in C11: the files of `steptwin kernel-c`, and its structures for those who call it.

It is here and not on the host or in the bench, because the emulated core executes it, and both the command line
(through the twin) and the bench may import it.
"""

from importlib.resources import files
from typing import Final

HEADER: Final = "steptwin_kernel.h"
BODY: Final = "steptwin_kernel.c"
MEMORY_COPY: Final = "memory.c"
"""memcpy, which gcc calls on its own."""
_FILES: Final = (HEADER, BODY, "README.md", "main.c", MEMORY_COPY)


def kernel_files() -> dict[str, str]:
    """Return the text of each file by its name: header, source, memcpy, an example, and a README with the limits."""
    folder = files(__name__)
    return {name: (folder / name).read_text(encoding="utf-8") for name in _FILES}
