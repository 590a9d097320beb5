"""How often the processes of StepTwin's own programs collect garbage: Python's default costs a seventh of a run."""

import gc
from typing import Final

_YOUNG_OBJECTS: Final = 50_000
"""Number of new objects between two collections: as many as a run makes and some more, and nearly all of them stay."""


def collect_seldom() -> None:
    """Let a program's process collect garbage seldom; a program that uses StepTwin as a library decides for itself."""
    gc.set_threshold(_YOUNG_OBJECTS)
