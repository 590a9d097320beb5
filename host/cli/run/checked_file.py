"""What `steptwin check` finds out about a file of any kind."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A file: what was found out, as a JSON document and in words, as `AnswerOptions.tell` takes them; or nothing.

    Attributes:
        document: what was found out.
        words: the same as lines, or functions that print more.
        advice: what would do in spite of the findings.
    """

    document: dict[str, Any] = field(default_factory=dict)
    words: tuple[str | Callable[[], None], ...] = ()
    advice: tuple[str, ...] = ()
