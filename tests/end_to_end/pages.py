"""The pages of documentation, for tests that run what they show."""

import re
import runpy
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[2]


def read_page(name: str) -> str:
    """Return the text of a page, such as `docs/live.md`."""
    return (ROOT / name).read_text(encoding="utf-8")


def blocks_of(text: str) -> list[tuple[str, str]]:
    """Return language and content of every fenced block."""
    return re.findall(r"^```(\w*)\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def run_python(code: str, folder: Path) -> dict[str, Any]:
    """Run a program in this process, from a file in a folder, as `python FILE` does; return its names."""
    file = folder / "program.py"
    file.write_text(code, encoding="utf-8")
    return runpy.run_path(str(file), run_name="__main__")
