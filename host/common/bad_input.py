"""Words for bad input that several modules share: each says in one line what was given and what would be right."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from math import isfinite

from steptwin.host.common.errors import InputError

_MS_TOLERANCE = 1e-6
"""Milliseconds by which a duration may miss a whole one: what decimal fractions of a second lose as floats."""

_CHOICES_LISTED = 12


def unknown(what: str, given: str, choices: Iterable[str]) -> InputError:
    """The error for a name that does not exist: it offers the nearest ones, or all when none is near."""
    names = list(choices)
    by_lower_case = {name.lower(): name for name in names}
    near = [by_lower_case[name] for name in get_close_matches(given.lower(), by_lower_case, n=3)]
    if near:
        return InputError(f"{what} {given!r} is unknown: did you mean {' or '.join(near)}?")
    listed = ", ".join(names[:_CHOICES_LISTED]) or "none"
    if len(names) > _CHOICES_LISTED:
        listed += f" and {len(names) - _CHOICES_LISTED} more"
    return InputError(f"{what} {given!r} is unknown: there are {listed}")


@contextmanager
def prefixed(prefix: str) -> Iterator[None]:
    """Say where bad input stands: every InputError from inside gets this in front and stays of its kind."""
    try:
        yield
    except InputError as error:
        raise type(error)(f"{prefix}{error}") from error


def require_positive(settings: object, *names: str) -> None:
    """Raise InputError unless these attributes are above 0."""
    for name in names:
        value = getattr(settings, name)
        if not value > 0:
            raise InputError(f"{name}: {value:g} is not above 0")


def whole_ms(what: str, value_s: float) -> int:
    """A time in milliseconds; InputError when it is not finite or not a whole number of them."""
    value_ms = 1000.0 * value_s
    if not (isfinite(value_ms) and abs(value_ms - round(value_ms)) <= _MS_TOLERANCE):
        raise InputError(f"{what}: {value_s:.9g} s is not a whole number of milliseconds")
    return round(value_ms)


def apart(value: float, limit: float) -> tuple[str, str]:
    """Both numbers with as many decimals as it takes to tell them apart, one at least and twelve at most."""
    for decimals in range(1, 13):
        texts = f"{value:.{decimals}f}", f"{limit:.{decimals}f}"
        if float(texts[0]) != float(texts[1]):  # "-0.0" is 0.0
            break
    return texts
