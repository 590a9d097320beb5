"""Marks for tests that many inputs share."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def slow_but(cheap: Collection[object], values: Iterable[Any]) -> list[Any]:
    """Return inputs for `parametrize`: those that are not among the cheap ones carry the mark `slow`."""
    return [value if value in cheap else pytest.param(value, marks=pytest.mark.slow) for value in values]
