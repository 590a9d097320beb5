"""What `steptwin check` finds out about a file of any kind."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


def _nothing() -> None:
    """Print nothing."""


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A file: what was found out, as a JSON document and as the function that prints it; nothing by default.

    Attributes:
        document: what was found out.
        print: prints it.
        advice: what would do in spite of the findings.
    """

    document: dict[str, Any]
    print: Callable[[], None] = _nothing
    advice: tuple[str, ...] = ()
