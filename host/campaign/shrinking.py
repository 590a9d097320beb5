"""Shrink the scenario of a failed run: the smallest one after which the run still fails alike."""

from collections.abc import Callable, Iterator
from copy import deepcopy
from math import floor, log10, trunc
from typing import Any, Final

from steptwin.host.campaign.values import AtPart, PlannedAt

Fails = Callable[[dict[str, Any]], bool]
"""Runs with a scenario's table instead of the drawn one; True if it fails as before."""

TRIES: Final = 80
"""Runs that the shrinking of a scenario takes at most."""
_FAULTS: Final = "fault"


class _TiredError(Exception):
    """All tries are used up."""


class _Tries:
    """Counts the runs, and remembers what has been tried: nothing is run twice."""

    def __init__(self, fails: Fails, most: int) -> None:
        self._fails = fails
        self._left = most
        self._tried: dict[str, bool] = {}

    def still_fails(self, table: dict[str, Any]) -> bool:
        key = repr(table)
        if key not in self._tried:
            if not self._left:
                raise _TiredError
            self._left -= 1
            self._tried[key] = self._fails(table)
        return self._tried[key]


def shrunk(table: dict[str, Any], fails: Fails, tries: int = TRIES) -> dict[str, Any]:
    """Return the smallest table found that still fails: with fewer faults, then fewer keys, then simpler numbers.

    Each simplification that still fails is kept, and all are tried again until none is (delta debugging; A. Zeller and
    R. Hildebrandt, IEEE Trans. Software Eng. 28, 2002). The table itself must fail.
    """
    counted, best = _Tries(fails, tries), deepcopy(table)
    try:
        while (simpler := _first(counted, best)) is not None:
            best = simpler
    except _TiredError:
        pass
    return best


def _first(tries: _Tries, table: dict[str, Any]) -> dict[str, Any] | None:
    """Return the first simplification that still fails; None if none does."""
    return next((simpler for simpler in _simpler(table) if tries.still_fails(simpler)), None)


def _simpler(table: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield tables that are simpler by one thing, the greatest simplifications first."""
    faults = table.get(_FAULTS, [])
    half = len(faults) // 2
    if half > 1:
        yield {**table, _FAULTS: faults[:half]}
        yield {**table, _FAULTS: faults[half:]}
    for number in range(len(faults)):
        yield {**table, _FAULTS: faults[:number] + faults[number + 1 :]}
    for number, fault in enumerate(faults):
        for key in fault:
            without = {name: value for name, value in fault.items() if name != key}
            yield {**table, _FAULTS: [*faults[:number], without, *faults[number + 1 :]]}
    for number, fault in enumerate(faults):
        for simpler in _simpler_numbers(fault):
            yield {**table, _FAULTS: [*faults[:number], simpler, *faults[number + 1 :]]}


def _simpler_numbers(value: Any) -> Iterator[Any]:
    """Yield a value with one of the numbers in it simpler: nearer to 0, or with fewer digits."""
    if isinstance(value, dict):
        for key, item in value.items():
            for simpler in _simpler_numbers(item):
                yield {**value, key: simpler}
    elif isinstance(value, list):
        for number, item in enumerate(value):
            for simpler in _simpler_numbers(item):
                yield [*value[:number], simpler, *value[number + 1 :]]
    elif isinstance(value, AtPart | PlannedAt):
        yield from (type(value)(part) for part in _simpler_numbers(value.part))
    elif isinstance(value, int | float) and not isinstance(value, bool) and value:
        yield from _weaker(value)


def _weaker(value: float) -> Iterator[float]:
    """Yield numbers that are nearer to 0 and have fewer digits than one other than 0."""
    for digits in (1, 2):
        parts = 10.0 ** (floor(log10(abs(value))) - digits + 1)
        shorter = float(f"{trunc(value / parts) * parts:.6g}")
        if 0 < abs(shorter) < abs(value):
            yield int(shorter) if isinstance(value, int) else shorter
    if isinstance(value, int):
        yield int(value / 2)
    elif abs(value) > _LEAST:
        yield float(f"{value / 2:.1g}")


_LEAST: Final = 1e-3
"""Numbers are not halved below this: an instant of 1 ms is early enough."""
