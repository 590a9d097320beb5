"""Write a table of plain values as TOML, for scenarios that were drawn or shrunk and for robots that were varied."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")
"""Keys that need no quotes."""


def toml_text(table: Mapping[str, Any]) -> str:
    """Return a table as TOML: its scalars first, then its inner tables, then its lists of tables.

    What is inside the tables of a list stands inline.
    """
    return "\n".join(_table("", table)) + "\n"


def _table(name: str, table: Mapping[str, Any]) -> Iterator[str]:
    yield from (_line(key, value) for key, value in table.items() if not _has_head(value))
    for key, value in sorted(table.items(), key=lambda item: _is_tables(item[1])):
        full = f"{name}.{_key(key)}" if name else _key(key)
        if isinstance(value, Mapping):
            yield f"\n[{full}]"
            yield from _table(full, value)
        for inner in value if _is_tables(value) else ():
            yield f"\n[[{full}]]"
            yield from (_line(inner_key, item) for inner_key, item in inner.items())


def _line(key: str, value: Any) -> str:
    return f"{_key(key)} = {_value(value)}"


def _has_head(value: Any) -> bool:
    return isinstance(value, Mapping) or _is_tables(value)


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {_value(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool):
        return json.dumps(value)
    return _text(value) if isinstance(value, str) else repr(value)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # as in JSON, but for one character
