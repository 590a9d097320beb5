"""Checks of input and their messages, shared by several modules: each names the value and a valid one in one line."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from difflib import get_close_matches
from functools import partial
from itertools import islice
from math import isfinite, isnan
from reprlib import repr as short

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import check_all


def printable(text: str) -> str:
    """Return a text as one line of printable characters, all others escaped as in Python: `\\x1b`, `\\n`, `\\u202e`.

    Printable are the characters that `str.isprintable` names; control and format characters, all spaces but the
    common one, and halves of surrogate pairs are not.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode("ascii") for each in text)


_MS_TOLERANCE = 1e-6
"""Milliseconds by which a duration may miss a whole one, since floats cannot hold most decimal fractions."""

_DIGITS = 6
"""Significant digits of a number that a message offers."""

_DISTANCE_DIGITS = 3
"""Significant digits of a distance that a message offers."""

_ROUNDING = 1e-9
"""Part of a distance that is taken for a rounding error of its computation."""

_CHARS_SHOWN = 100
"""Number of characters of an unknown name that a message or a picture shows at most."""

_NEAREST_MAX = 3
"""Number of names that a message offers in place of an unknown one at most."""

_COMPARED_MAX = 300
"""Number of names with which an unknown one is compared, so that thousands of both take no minutes."""

_BEGINNING_CHARS = 2
"""Number of characters from which on they may be the beginning of a name."""

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


def known(what: str, given: object, choices: Iterable[str]) -> str:
    """Return a name that is among the choices; raise InputError for another one, or for a value that is no text."""
    names = list(choices)
    if not isinstance(given, str):
        raise InputError(f"{what} {short(given)} is not a text")
    if given not in names:
        raise unknown(what, given, names)
    return given


def nearest(given: str, choices: Iterable[str]) -> list[str]:
    """Return up to three names that begin with the given one or are most like it, whatever the case; none without any.

    So `l1` is near `l1_mm`, though most of its characters are missing.
    """
    by_lower_case = {name.lower(): name for name in islice(choices, _COMPARED_MAX)}
    text = shortened(given).lower()
    longer = [name for name in by_lower_case if len(text) >= _BEGINNING_CHARS and name.startswith(text)]
    near = dict.fromkeys([*longer, *get_close_matches(text, by_lower_case, n=_NEAREST_MAX)])
    return [by_lower_case[name] for name in list(near)[:_NEAREST_MAX]]


def shortened(text: str) -> str:
    """Return a text from outside with at most 100 characters and three points."""
    return text if len(text) <= _CHARS_SHOWN else f"{text[:_CHARS_SHOWN]}..."


@contextmanager
def prefixed(prefix: str) -> Iterator[None]:
    """Put a prefix, such as the place of the input, in front of the message of every InputError from the block."""
    try:
        yield
    except InputError as error:
        raised = type(error)(*(f"{prefix}{message}" for message in error.messages))
        raise raised.plainly(f"{prefix}{error.plain}") from error


def require_positive(settings: object, *names: str) -> None:
    """Raise InputError, with a message for each, unless these attributes are above 0."""
    check_all(*(partial(_require_positive, settings, name) for name in names))


def _require_positive(settings: object, name: str) -> None:
    value = getattr(settings, name)
    if not value > 0:
        raise InputError(f"{name}: {value:g} is not above 0")


def whole_ms(what: str, value_s: float) -> int:
    """Return a time in milliseconds; raise InputError, with the nearest valid time, unless it is a whole number."""
    value_ms = 1000.0 * value_s
    if not isfinite(value_ms):
        raise InputError(f"{what}: {value_s:.9g} s is not a whole number of milliseconds")
    if abs(value_ms - round(value_ms)) > _MS_TOLERANCE:
        near = f"the nearest is {max(round(value_ms), 1) / 1000:.9g} s"
        raise InputError(f"{what}: {value_s:.9g} s is not a whole number of milliseconds: {near}")
    return round(value_ms)


def apart(value: float, limit: float) -> tuple[str, str]:
    """Return both numbers with enough decimals to tell them apart, from one to twelve; short if none do."""
    for decimals in range(1, 13):
        texts = f"{value:.{decimals}f}", f"{limit:.{decimals}f}"
        if float(texts[0]) != float(texts[1]):  # "-0.0" is 0.0
            return texts
    return f"{value:g}", f"{limit:g}"


# --- limits, and what keeps them


def outside(value: float, lower: float, upper: float, unit: str, when: str = "") -> str:
    """Return that a value, at some instant, is outside its limits, with enough decimals to see that it is."""
    text, _ = apart(value, lower if value < lower else upper)
    unit = f" {unit}" if unit else ""
    return f"{text}{unit}{when} is outside {lower:g}..{upper:g}{unit}"


def nearest_within(value: float, lower: float, upper: float, unit: str) -> str:
    """Return, after a semicolon, which value between two limits is the nearest to one outside; nothing for NaN.

    The number in the text is between the limits.
    """
    if isnan(value):
        return ""
    text = at_least(lower) if value < lower else at_most(upper)
    if not lower <= float(text) <= upper:  # limits that differ in the seventh digit
        text = repr(lower if value < lower else upper)
    return f"; the nearest is {text} {unit}"


_WRITTEN_OUT = 1e9
"""Distance up to which one is written without an exponent."""


def by(distance: float, unit: str) -> str:
    """Return a distance from a limit as text, rounded up to three digits, so that going back so far is enough."""
    text = _rounded(distance * (1 - _ROUNDING), ROUND_CEILING, _DISTANCE_DIGITS)
    return f"{float(text):.0f} {unit}" if "e+" in text and distance < _WRITTEN_OUT else f"{text} {unit}"


def at_most(limit: float) -> str:
    """Return a limit rounded down to six significant digits, so that the number in the text keeps it."""
    return _rounded(limit, ROUND_FLOOR)


def at_least(limit: float) -> str:
    """Return a limit rounded up to six significant digits, so that the number in the text keeps it."""
    return _rounded(limit, ROUND_CEILING)


def _rounded(value: float, rounding: str, digits: int = _DIGITS) -> str:
    text = f"{value:.{digits}g}"
    if float(text) == value:  # as it was written: the float of 3276.7 itself is a little less
        return text
    return f"{float(Context(prec=digits, rounding=rounding).create_decimal_from_float(value)):.{digits}g}"
