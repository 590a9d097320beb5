"""The files of `steptwin kernel-c`: header, source, an example and what a firmware's author must know."""

from importlib.resources import files
from typing import Final

from steptwin.emulator.kernel_c.source import kernel_source
from steptwin.emulator.kernel_c.translation import BODY, HEADER, translate

_PARTS: Final = ("README.md", "main.c", "memory.c")


def kernel_files() -> dict[str, str]:
    """Return the text of each file by its name."""
    made = translate()
    parts = files("steptwin.emulator.kernel_c") / "parts"
    texts = {name: (parts / name).read_text(encoding="utf-8") for name in _PARTS}
    records = kernel_source().records
    for name, record in records.items():
        texts["README.md"] = texts["README.md"].replace(f"{{{name}_bytes}}", str(record.size))
    return {HEADER: made.header, BODY: made.body, **texts}
