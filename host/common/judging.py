"""Judge settings of which some could not be read: each check is made whose values are there."""

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, fields
from typing import Any, Final, TypeVar

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings, UnreadError

Made = TypeVar("Made")

_KEY: Final = re.compile(r"\w+")
"""The field with which a message begins."""


def judged(make: type[Made], values: Mapping[str, object], findings: Findings) -> Made:
    """Return the settings with these values of fields, and add to `findings` what is wrong with them.

    A field that is not among the values could not be read. None stands for a missing one, which takes its default. If
    something is unread or wrong, the settings returned are a part: a field that they lack raises UnreadError, so that
    no other check complains about it once more.

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
    whole: type[Any] = make
    part: Made = object.__new__(_part_class(whole))
    for name, value in values.items():
        object.__setattr__(part, name, value)
    return part


def _part_class(make: type[Any]) -> type[Any]:
    return type(make.__name__, (make,), {"__slots__": (), "__getattr__": _unread})


def _unread(_: object, name: str) -> object:
    raise UnreadError(name)


def _fields(make: type[Any]) -> tuple[Field[Any], ...]:
    return fields(make)


def _given(field: Field[Any], value: object) -> object:
    """Return a value, or the default of its field in place of None."""
    if value is not None:
        return value
    if field.default_factory is not MISSING:
        return field.default_factory()
    return None if field.default is MISSING else field.default
