"""Input checks and their messages, which name the value and a valid one in one line."""

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
    """Return a text as one line of printable characters; escape the others as in Python: `\\x1b`, `\\n`, `\\u202e`.

    `str.isprintable` defines which characters are printable. Control and format characters, spaces other than the
    common one, and halves of surrogate pairs are not.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode("ascii") for each in text)


_MS_TOLERANCE = 1e-6
"""Allowed difference of a duration from whole milliseconds, because floats cannot hold most decimal fractions."""
_DIGITS = 6
"""Significant digits of a number in a message."""
_DISTANCE_DIGITS = 3
"""Significant digits of a distance in a message."""
_ROUNDING = 1e-9
"""Fraction of a distance that is treated as rounding error."""
_CHARS_SHOWN = 100
"""Highest number of characters of an unknown name in a message or picture."""
_NEAREST_MAX = 3
"""Highest number of similar names in a message about an unknown one."""
_COMPARED_MAX = 300
"""Highest number of names that are compared with an unknown one: thousands would take minutes."""
_BEGINNING_CHARS = 2
"""Least number of characters that are treated as the beginning of a name."""
_CHOICES_LISTED = 12
"""Highest number of choices in a message."""


def unknown(what: str, given: str, choices: Iterable[str]) -> InputError:
    """Return the error for an unknown name; its message names similar ones, or lists all if none is similar."""
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
    """Return a name if it is one of the choices; raise InputError for another name, or a value that is no text."""
    names = list(choices)
    if not isinstance(given, str):
        raise InputError(f"{what} {short(given)} is not a text")
    if given not in names:
        raise unknown(what, given, names)
    return given


def nearest(given: str, choices: Iterable[str]) -> list[str]:
    """Return up to three names that begin with the given one or are similar to it, ignoring case.

    For example `l1_mm` is similar to `l1`, although most of its characters are missing.
    """
    by_lower_case = {name.lower(): name for name in islice(choices, _COMPARED_MAX)}
    text = shortened(given).lower()
    longer = [name for name in by_lower_case if len(text) >= _BEGINNING_CHARS and name.startswith(text)]
    near = dict.fromkeys([*longer, *get_close_matches(text, by_lower_case, n=_NEAREST_MAX)])
    return [by_lower_case[name] for name in list(near)[:_NEAREST_MAX]]


def shortened(text: str) -> str:
    """Return an external text, cut to 100 characters and three points."""
    return text if len(text) <= _CHARS_SHOWN else f"{text[:_CHARS_SHOWN]}..."


@contextmanager
def prefixed(prefix: str) -> Iterator[None]:
    """Prepend a prefix, such as the position in the input, to the message of every InputError of the block."""
    try:
        yield
    except InputError as error:
        raised = type(error)(*(f"{prefix}{message}" for message in error.messages))
        raise raised.plainly(f"{prefix}{error.plain}") from error


def require_positive(settings: object, *names: str) -> None:
    """Raise InputError, with one message for each, for attributes that are not above 0."""
    check_all(*(partial(_require_positive, settings, name) for name in names))


def _require_positive(settings: object, name: str) -> None:
    value = getattr(settings, name)
    if not value > 0:
        raise InputError(f"{name}: {value:g} is not above 0")


def whole_ms(what: str, value_s: float) -> int:
    """Convert a time to milliseconds; raise InputError, with the nearest valid time, if it is not a whole number."""
    value_ms = 1000.0 * value_s
    if not isfinite(value_ms):
        raise InputError(f"{what}: {value_s:.9g} s is not a whole number of milliseconds")
    if abs(value_ms - round(value_ms)) > _MS_TOLERANCE:
        near = f"the nearest is {max(round(value_ms), 1) / 1000:.9g} s"
        raise InputError(f"{what}: {value_s:.9g} s is not a whole number of milliseconds: {near}")
    return round(value_ms)


def apart(value: float, limit: float) -> tuple[str, str]:
    """Format both numbers with as many decimals, one to twelve, as show their difference."""
    for decimals in range(1, 13):
        texts = f"{value:.{decimals}f}", f"{limit:.{decimals}f}"
        if float(texts[0]) != float(texts[1]):  # "-0.0" is 0.0
            return texts
    return f"{value:g}", f"{limit:g}"


# --- limits


def outside(value: float, lower: float, upper: float, unit: str, when: str = "") -> str:
    """Return a text that a value is outside of its limits, with enough decimals to show it."""
    text, _ = apart(value, lower if value < lower else upper)
    unit = f" {unit}" if unit else ""
    return f"{text}{unit}{when} is outside {lower:g}..{upper:g}{unit}"


def nearest_within(value: float, lower: float, upper: float, unit: str) -> str:
    """Return a text, after a semicolon, with the nearest value between two limits; an empty text for NaN.

    The number in the text is between the limits.
    """
    if isnan(value):
        return ""
    text = at_least(lower) if value < lower else at_most(upper)
    if not lower <= float(text) <= upper:  # limits that differ in the seventh digit
        text = repr(lower if value < lower else upper)
    return f"; the nearest is {text} {unit}"


_WRITTEN_OUT = 1e9
"""Largest distance that is written without an exponent."""


def by(distance: float, unit: str) -> str:
    """Format a distance beyond a limit, rounded up to three digits: reducing the value by it keeps the limit."""
    text = _rounded(distance * (1 - _ROUNDING), ROUND_CEILING, _DISTANCE_DIGITS)
    return f"{float(text):.0f} {unit}" if "e+" in text and distance < _WRITTEN_OUT else f"{text} {unit}"


def at_most(limit: float) -> str:
    """Format an upper limit, rounded down to six significant digits: the number in the text keeps the limit."""
    return _rounded(limit, ROUND_FLOOR)


def at_least(limit: float) -> str:
    """Format a lower limit, rounded up to six significant digits: the number in the text keeps the limit."""
    return _rounded(limit, ROUND_CEILING)


def _rounded(value: float, rounding: str, digits: int = _DIGITS) -> str:
    text = f"{value:.{digits}g}"
    if float(text) == value:  # as it was written: the float of 3276.7 itself is a little less
        return text
    return f"{float(Context(prec=digits, rounding=rounding).create_decimal_from_float(value)):.{digits}g}"
