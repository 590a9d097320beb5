"""Junk in place of every value of a document, one at a time: whatever a user mistypes, readers refuse it in a line."""

import datetime as dt
import json
import tomllib
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import partial
from itertools import islice
from typing import Any, Final

import pytest

from steptwin.host.common.errors import InputError

JUNK: Final[tuple[Any, ...]] = (
    None,
    True,
    -1,
    0,
    10**30,
    -0.5,
    1e300,
    float("nan"),
    float("inf"),
    "",
    "junk",
    "x\ny\x1b[31m",
    "\N{GREEK SMALL LETTER ALPHA}" * 300,
    dt.date(2026, 11, 23),
    [],
    [[]],
    [None],
    [{}],
    {},
    {"junk": {}},
    {"choose": []},
)
"""What stands in place of a value. In TOML there is no null: an empty text stands for it."""
_STRANGE_KEYS: Final = ("junk", "", "th22", "\x7f" * 100)


def junk_documents(document: dict[str, Any]) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """Yield each change of one place in words, and what makes the document with it: junk, a missing or strange key.

    A document is made only when it is called for: tests that try one of so many would copy all the others for nothing.
    """
    for path in _paths(document):
        at, changed = ".".join(map(str, path)), partial(_changed, document, path)
        for junk in JUNK:
            yield f"{at} = {junk!r}", partial(changed, partial(_put, value=junk))
        yield f"without {at}", partial(changed, lambda inside, key: inside.pop(key))
        yield f"{at} in a list", partial(changed, lambda inside, key: _put(inside, key, [inside[key]]))
        for strange in _STRANGE_KEYS:
            yield f"{at} is called {strange!r}", partial(changed, partial(_rename, new=strange))


def _paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from _paths(item, (*path, key))


def _changed(document: dict[str, Any], path: tuple[Any, ...], change: Any) -> dict[str, Any]:
    changed = deepcopy(document)
    inside: Any = changed
    for key in path[:-1]:
        inside = inside[key]
    change(inside, path[-1])
    return changed


def _put(inside: Any, key: Any, value: Any) -> None:
    inside[key] = deepcopy(value)


def _rename(inside: Any, key: Any, new: str) -> None:
    if isinstance(inside, dict):
        inside[new] = inside.pop(key)
    else:
        inside[key] = {new: inside[key]}


def toml_of(document: dict[str, Any]) -> str:
    """Return a document as TOML, its tables inline."""
    return "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in document.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if value is None or isinstance(value, str):
        return _quoted(value or "")
    if isinstance(value, bool):
        return str(value).lower()
    return value.isoformat() if isinstance(value, dt.date) else repr(value)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def check_junk(text: str, read: Callable[[str], object], stride: int) -> None:
    """Check that a reader takes a TOML text, and each `stride`-th change of it, or refuses that in lines."""
    document: dict[str, Any] = tomllib.loads(text)
    read(toml_of(document))
    for change, changed in islice(junk_documents(document), 0, None, stride):
        try:
            read(toml_of(changed()))
        except InputError as error:
            told = error.messages
        except Exception as error:
            pytest.fail(f"{change}: {type(error).__name__}: {error}")
        else:
            continue
        assert all(message and "\n" not in message and "\x1b" not in message for message in told), change
