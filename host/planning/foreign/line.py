"""A line of another controller's program: a step of ours, a remark, or one that is left out and why."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from steptwin.host.common.bad_input import printable


@dataclass(frozen=True, slots=True)
class TakenOver:
    """A step.

    Attributes:
        keys: its keys and values, as a program has them.
        pace: what the line says about its speed, where that is none of the tool's; else empty.
    """

    keys: Mapping[str, Any]
    pace: str = ""

    @property
    def needs_speed(self) -> bool:
        """True for a straight move whose line says no speed of the tool."""
        return "line" in self.keys and "speed_mm_s" not in self.keys


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A line that is no step, as it was written, and why."""

    text: str
    why: str


@dataclass(frozen=True, slots=True)
class Remark:
    """A comment; an empty one is a line that says nothing."""

    text: str


ReadLine = TakenOver | LeftOut | Remark


def text_of(line: ReadLine, line_speed_mm_s: float) -> str:
    """Return the text of a line in a program; the speed is that of a straight move without its own."""
    match line:
        case TakenOver(keys, pace):
            speed = {"speed_mm_s": line_speed_mm_s} if line.needs_speed else {}
            rows = [f"{key} = {value_text(each)}" for key, each in (dict(keys) | speed).items()]
            there = f"  # there: {printable(pace)}" if pace else ""
            return "\n".join(["[[step]]", *rows]) + there
        case LeftOut(text, why):
            return f"# left out, {why}: {printable(text)}"
        case Remark(text):
            return f"# {printable(text)}" if text else ""


def value_text(value: object) -> str:
    """Return the TOML text of a number, a text, a list or a table."""
    match value:
        case dict():
            return f"{{ {', '.join(f'{key} = {value_text(each)}' for key, each in value.items())} }}"
        case list():
            return f"[{', '.join(map(value_text, value))}]"
        case str():
            return json.dumps(value, ensure_ascii=False)  # TOML escapes as JSON does
    return repr(value)
