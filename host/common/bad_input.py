"""Checks of input and their messages, shared by several modules: each names the value and a valid one in one line."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from math import isfinite

from steptwin.host.common.errors import InputError

_MS_TOLERANCE = 1e-6
"""Milliseconds by which a duration may miss a whole one, since floats cannot hold most decimal fractions."""

_CHARS_SHOWN = 100
"""Number of characters of an unknown name that a message or a picture shows at most."""

_CHOICES_LISTED = 12
"""Number of choices that a message lists at most."""


def unknown(what: str, given: str, choices: Iterable[str]) -> InputError:
    """Return the error for an unknown name; its message offers the nearest names, or lists all if none is near."""
    given = shortened(given)
    names = list(choices)
    near = nearest(given, names)
    if near:
        return InputError(f"{what} {given!r} is unknown: did you mean {' or '.join(near)}?")
    listed = ", ".join(names[:_CHOICES_LISTED]) or "none"
    if len(names) > _CHOICES_LISTED:
        listed += f" and {len(names) - _CHOICES_LISTED} more"
    return InputError(f"{what} {given!r} is unknown: there are {listed}")


def nearest(given: str, choices: Iterable[str]) -> list[str]:
    """Return up to three names that are most like the given one, whatever the case; none if no name is like it."""
    by_lower_case = {name.lower(): name for name in choices}
    return [by_lower_case[name] for name in get_close_matches(shortened(given).lower(), by_lower_case, n=3)]


def shortened(text: str) -> str:
    """Return a text from outside with at most 100 characters and three points."""
    return text if len(text) <= _CHARS_SHOWN else f"{text[:_CHARS_SHOWN]}..."


@contextmanager
def prefixed(prefix: str) -> Iterator[None]:
    """Put a prefix, such as the place of the input, in front of the message of every InputError from the block."""
    try:
        yield
    except InputError as error:
        raise type(error)(*(f"{prefix}{message}" for message in error.messages)) from error


def require_positive(settings: object, *names: str) -> None:
    """Raise InputError, with a message for each, unless these attributes are above 0."""
    values = {name: getattr(settings, name) for name in names}
    if messages := [f"{name}: {value:g} is not above 0" for name, value in values.items() if not value > 0]:
        raise InputError(*messages)


def whole_ms(what: str, value_s: float) -> int:
    """Return a time in milliseconds; raise InputError unless it is a whole number of them."""
    value_ms = 1000.0 * value_s
    if not (isfinite(value_ms) and abs(value_ms - round(value_ms)) <= _MS_TOLERANCE):
        raise InputError(f"{what}: {value_s:.9g} s is not a whole number of milliseconds")
    return round(value_ms)


def apart(value: float, limit: float) -> tuple[str, str]:
    """Return both numbers with enough decimals to tell them apart, from one to twelve."""
    for decimals in range(1, 13):
        texts = f"{value:.{decimals}f}", f"{limit:.{decimals}f}"
        if float(texts[0]) != float(texts[1]):  # "-0.0" is 0.0
            break
    return texts
