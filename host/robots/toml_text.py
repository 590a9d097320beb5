"""Write the lines of a TOML table."""

import json
from collections.abc import Mapping


def toml_lines(values: Mapping[str, object], notes: Mapping[str, str]) -> str:
    """Return a line for each value, its notes in one column."""
    rows = {key: f"{key} = {toml_value(value)}" for key, value in values.items()}
    width = max(map(len, rows.values()))
    return "".join(f"{row:<{width}} # {notes[key]}\n" if key in notes else f"{row}\n" for key, row in rows.items())


def toml_value(value: object) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {toml_value(each)}' for key, each in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(str(value), ensure_ascii=False) if isinstance(value, str) else repr(value)
