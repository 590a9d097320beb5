"""Marks for tests that many inputs share."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def slow_but(cheap: Collection[object], values: Iterable[Any]) -> list[Any]:
    """Return inputs for `parametrize`, tuples for several names: those that are not cheap carry the mark `slow`."""

    def marked(value: Any) -> Any:
        return pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.slow)

    return [value if value in cheap else marked(value) for value in values]
