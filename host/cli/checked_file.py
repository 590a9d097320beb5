"""What `steptwin check` finds out about a file of any kind."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


def _nothing() -> None:
    """Print nothing."""


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A file: what was found out, as a JSON document and as the function that prints it; nothing by default."""

    document: dict[str, Any]
    print: Callable[[], None] = _nothing
