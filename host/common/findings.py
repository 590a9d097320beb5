"""Find everything that is wrong in an input at once, instead of stopping at the first error."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import MISSING, Field, fields
from functools import cache
from typing import Any, Final, TypeVar

from steptwin.host.common.errors import InputError


class UnreadError(Exception):
    """A value was asked for that could not be read; its error has been found already."""


class Findings:
    """The errors of one input; each block under `collecting` ends with its first error, and the work goes on."""

    def __init__(self, messages: list[str] | None = None, place: str = "") -> None:
        self.messages: list[str] = [] if messages is None else messages
        """Messages of the errors, in the order that they were found."""
        self.place = place
        """Where in the input they are: in front of each message."""

    def under(self, place: str) -> "Findings":
        """Return findings in a part of the input, whose messages get its place in front; all share one list."""
        return Findings(self.messages, f"{self.place}{place}")

    def add(self, *messages: str) -> None:
        """Keep messages of errors."""
        self.messages.extend(f"{self.place}{message}" for message in messages)

    @contextmanager
    def collecting(self, prefix: str = "") -> Iterator[None]:
        """Keep the messages of an InputError from the block, with a prefix such as its place in the file.

        A block that needs a value that could not be read ends without a message.
        """
        try:
            yield
        except InputError as error:
            self.add(*(f"{prefix}{message}" for message in error.messages))
        except UnreadError:
            return

    def raise_first(self) -> None:
        """Raise one InputError with all messages if there are any, for a caller that needs the input to be right.

        The first message is its text.
        """
        if self.messages:
            raise InputError(*self.messages)


def check_all(*checks: Callable[[], object]) -> None:
    """Make every check; raise one InputError with the messages of all that failed."""
    findings = Findings()
    for check in checks:
        with findings.collecting():
            check()
    findings.raise_first()


Made = TypeVar("Made")

_KEY: Final = re.compile(r"\w+")
"""The field with which a message begins."""


def judged(make: type[Made], values: Mapping[str, object], findings: Findings) -> Made:
    """Return the settings with these values of fields, and add to `findings` what is wrong with them.

    A field that is not among the values could not be read. None stands for a missing one, which takes its default. If
    something is unread or wrong, the settings returned are incomplete: reading a field that they lack raises
    UnreadError, so that no other check complains about it once more.

    `make` is a frozen dataclass whose `__post_init__` makes its checks, and whose messages begin with the wrong field.
    """
    known = {field.name: _given(field, values[field.name]) for field in _fields(make) if field.name in values}
    if len(known) == len(_fields(make)):
        with suppress(InputError, UnreadError):
            return make(**known)
    while True:
        settings, errors = part_of(make, known), Findings()
        if hasattr(make, "__post_init__"):
            with errors.collecting():
                settings.__post_init__()  # type: ignore[attr-defined]
        findings.add(*errors.messages)
        wrong = {key[0] for message in errors.messages if (key := _KEY.match(message))} & known.keys()
        if not wrong:
            return settings
        known = {name: value for name, value in known.items() if name not in wrong}


def part_of(make: type[Made], values: Mapping[str, object]) -> Made:
    """Return settings with these fields only; any other raises UnreadError. Nothing is checked."""
    model: Any = make
    part: Made = object.__new__(_part_class(model))
    for name, value in values.items():
        object.__setattr__(part, name, value)
    return part


class Part:
    """Base of settings that are incomplete, since something in them is wrong: reading a field that they lack raises."""

    __slots__ = ()

    def __getattr__(self, name: str) -> object:
        raise UnreadError(name)


@cache
def _part_class(make: Any) -> type[Any]:
    return type(make.__name__, (make, Part), {"__slots__": ()})


def _fields(make: type[Any]) -> tuple[Field[Any], ...]:
    return fields(make)


def _given(field: Field[Any], value: object) -> object:
    """Return a value, or the default of its field in place of None."""
    if value is not None:
        return value
    if field.default_factory is not MISSING:
        return field.default_factory()
    return None if field.default is MISSING else field.default
