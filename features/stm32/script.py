"""A script that plays while an image runs: what it is sent, and what it must answer.

A line is an action, with an instant in front of it before which it does not begin, counted from power-up:

    # time  action
    expect "ready" 100ms
    send "G91\\n"
    expect "ok"
    can 201#0102
    50ms send usart2 "ping\\r\\n"
    1.5s

A text stands in quotation marks, with \\n, \\r, \\t, \\" and \\\\ as in JSON. Without a USART it is USART1; without a
time `expect` waits 1 s. A line of a time alone lets the image run until then.
"""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from re import Match, Pattern
from typing import Final, NamedTuple

from steptwin.features.stm32.tools import ImageTools, Usart
from steptwin.host.common.bad_input import shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.protocol.frame import Frame

_BYTES_MAX: Final = 1 << 20
_UNITS_S: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_TIME: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)(s|ms|us)(?=\s|$)")
_TEXT: Final = r'(?:usart([1-3])\s+)?("(?:[^"\\]|\\.)*")'
_WRITTEN: Final = re.compile(r'((?:[^"#]|(?<=\S)#|"(?:[^"\\]|\\.)*")*)(?:#.*)?$')
"""A line, and its comment behind a blank."""
_WITHIN_S: Final = 1.0


class Action(NamedTuple):
    """A kind of action.

    Attributes:
        form: how it is written, for messages.
        pattern: its arguments.
        play: does it; raises ExpectationError if the image does not answer.
    """

    form: str
    pattern: Pattern[str]
    play: Callable[[ImageTools, Match[str]], None]


def _usart(tools: ImageTools, found: Match[str]) -> Usart:
    return tools.usarts[int(found[1] or 1) - 1]


def _send(tools: ImageTools, found: Match[str]) -> None:
    _usart(tools, found).write(json.loads(found[2]))


def _expect(tools: ImageTools, found: Match[str]) -> None:
    within = _TIME.fullmatch(found[3] or "")
    _usart(tools, found).expect(json.loads(found[2]), _WITHIN_S if within is None else _seconds(within))


def _can(tools: ImageTools, found: Match[str]) -> None:
    tools.send_frame(Frame(int(found[1], 16), bytes.fromhex(found[2])))


ACTIONS: Final[Mapping[str, Action]] = {
    "send": Action('send "TEXT\\n"', re.compile(_TEXT), _send),
    "can": Action("can 201#0102", re.compile(r"([0-7][0-9A-Fa-f]{2})#((?:[0-9A-Fa-f]{2}){0,8})"), _can),
    "expect": Action('expect "TEXT" 100ms', re.compile(rf"{_TEXT}(?:\s+({_TIME.pattern}))?"), _expect),
}
"""The actions by the first word of their lines."""


class ScriptLine(NamedTuple):
    """A line of a script: its place for messages, its instant or None, and its action with arguments or None."""

    place: str
    at_s: float | None
    action: Action | None
    arguments: Match[str] | None

    def play(self, tools: ImageTools) -> None:
        """Wait for the instant, and do the action."""
        if self.at_s is not None and self.at_s > tools.now_s:
            tools.wait(self.at_s - tools.now_s)
        if self.action is not None and self.arguments is not None:
            self.action.play(tools, self.arguments)


def duration_s(text: str) -> float | None:
    """Return a time such as 2s, 50ms or 100us in seconds; None for another text."""
    found = _TIME.fullmatch(text)
    return None if found is None else _seconds(found)


def _seconds(found: Match[str]) -> float:
    return float(found[1]) * _UNITS_S[found[2]]


def read_script(path: Path) -> tuple[ScriptLine, ...]:
    """Return the lines of a script; the InputError's messages are all that is wrong, each with its line."""
    findings, lines = Findings(), list[ScriptLine]()
    for number, text in enumerate(read_text(path, _BYTES_MAX).splitlines(), start=1):
        written = _WRITTEN.match(text)
        line = text.strip() if written is None else written[1].strip()
        if line:
            with findings.collecting(f"{path}: line {number}: "):
                lines.append(_line(f"{path}: line {number}", line))
    findings.raise_first()
    if not lines:
        raise InputError(f"{path}: has no line with an action, such as {ACTIONS['expect'].form}")
    return tuple(lines)


def _line(place: str, text: str) -> ScriptLine:
    at_s = None
    if found := _TIME.match(text):
        at_s, text = _seconds(found), text[found.end() :].strip()
        if not text:
            return ScriptLine(place, at_s, None, None)
    name, _, rest = text.partition(" ")
    if name not in ACTIONS:
        raise unknown("action", name, ACTIONS)
    action = ACTIONS[name]
    arguments = action.pattern.fullmatch(rest.strip())
    if arguments is None:
        raise InputError(f"{shortened(text)}: is not written as {action.form}")
    try:
        json.loads(arguments[2] if arguments[2].startswith('"') else "0")
    except ValueError:
        raise InputError(f"{shortened(text)}: its text has a \\ before a character that needs none") from None
    return ScriptLine(place, at_s, action, arguments)
