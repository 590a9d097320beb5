"""What pages show of errors: no word of the bus or of the command line, whatever part of the host raises them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import steptwin.host.client
from steptwin.features.panel.service.messages import operator_message
from steptwin.host.client.stopping import UNSURE, unsure
from steptwin.host.client.words import ERRORS, HINDRANCES, STATES, error_words, hindrance_words
from steptwin.host.common.errors import BusError, InputError
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from tests.end_to_end.marks import slow_but

ROOT = Path(steptwin.host.client.__file__).resolve().parents[2]
ROOMS = ("host/client", "host/operate", "host/planning", "features/panel", "features/fastest", "features/gcode")
"""What the panel calls; its errors can reach a page."""
ELSEWHERE = {
    "positions.py": "the page asks before it replaces a position",
    "options.py": "the option is one of `run` and `check`",
    "points.py": "the page gives no elbow for a file",
    "ros_points.py": "the option is one of ros2, with which the user has printed the file",
}
"""Modules and folders of which an error with an option of the command line cannot reach a page, and why."""
JARGON = re.compile(
    r"\bnodes?\b|\bSDOs?\b|\bPDOs?\b|\bNMT\b|\bEMCY\b|\bSYNC\b|\bCiA\b|\bheartbeat|\bPVT\b|\brecords?\b|statusword"
    r"|controlword|OPERATION ENABLED|QUICK STOP|SWITCH ON|\bFAULT\b|\b0x|\bsteptwin\b|(?<!\w)--\w|\b\w+="
)
STATE_TEXT = "QUICK STOP ACTIVE"
"""What stands for a drive's state as the standard writes it."""


def text_of(node: ast.expr) -> str:
    """Return a message as it may read, with 1 for each value."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(text_of(part) for part in parts)
        case ast.FormattedValue(value=ast.Call(func=ast.Name(id="state_text"))):
            return STATE_TEXT
        case ast.BinOp(left=left, right=right):
            return text_of(left) + text_of(right)
    return "1"


def errors_in(path: Path) -> Iterator[tuple[str, InputError]]:
    """Yield every error that a module makes, with its place."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    plain = dict(plain_texts(tree))
    kinds = ("InputError", "BusError", "DeviceFaultError", "TooFastError", "OutsideError", "WaitTimeoutError")
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in kinds and call.args:
            error = InputError(text_of(call.args[0]))
            if id(call) in plain:
                error.plainly(plain[id(call)])
            yield f"{path.name}:{call.lineno}", error


def plain_texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the call that makes an error, by its identity, and the text that `plainly` gives it."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Attribute(value=ast.Call() as call, attr="plainly"), args=[text]):
                yield id(call), text_of(text)


@pytest.mark.slow
@pytest.mark.parametrize("room", slow_but([room for room in ROOMS if room != "host/planning"], ROOMS))
def test_no_error_shows_a_page_a_word_of_the_bus_or_of_the_command_line(room: str) -> None:
    paths = [path for path in sorted((ROOT / room).rglob("*.py")) if path.parent.name not in ELSEWHERE]
    made = [each for path in paths for each in errors_in(path)]
    assert len(made) >= 2
    shown = {place: operator_message(error) for place, error in made if place.split(":")[0] not in ELSEWHERE}
    assert {place: text for place, text in shown.items() if JARGON.search(text)} == {}


def test_an_error_has_two_texts() -> None:
    error = BusError("th2: node 0x11 does not answer (No SDO response received)").plainly("th2 does not answer")
    assert (str(error), error.plain, operator_message(error)) == (
        error.args[0],
        "th2 does not answer",
        "th2 does not answer",
    )
    assert operator_message(InputError("th2: 1 is outside 2..3")) == "th2: 1 is outside 2..3"
    assert unsure(error).plain == f"th2 does not answer; {UNSURE}"


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (
            "th2: a speed of 3.0 deg/s at t = 1.000 s is more than 2.0 deg/s; 1.5 times slower passes (stretch=1.5)",
            "th2: a speed of 3.0 deg/s at t = 1.000 s is more than 2.0 deg/s; 1.5 times slower passes: "
            'choose the speed "as slow as it must be"',
        ),
        ("no stretch up to 1000 makes it pass", "not even 1000 times slower passes"),
        ("a run-in and a run-out of 2 s pass (ramps_s=2)", "a run-in and a run-out of 2 s pass"),
        (
            "it stands at 3 mm; approach=True moves it there first",
            'it stands at 3 mm; switch on "first move to its start"',
        ),
        ("repeat=2: d1 ends at 9 mm; repeat=1 passes", "repetitions: 2: d1 ends at 9 mm; it can be run once"),
        (
            "d1: the robot's file has no homing for it; declare where it stands instead",
            'd1: it has no switch: use "Declare as position" in Move',
        ),
    ],
)
def test_a_parameter_becomes_what_the_page_offers(message: str, words: str) -> None:
    assert operator_message(InputError(message)) == words


def test_every_state_and_error_has_words() -> None:
    assert set(STATES) == set(State)
    assert set(ERRORS) == set(ErrorCode)
    assert error_words(0x7777) == "unknown error 0x7777"
    assert [text for text in (*STATES.values(), *ERRORS.values(), *HINDRANCES.values()) if JARGON.search(text)] == []


def test_the_emergency_stop_is_the_first_hindrance() -> None:
    assert hindrance_words(DigitalInput.HOME | DigitalInput.IN1) is None
    assert hindrance_words(DigitalInput.ESTOP | DigitalInput.DRIVER_PROTECT) == HINDRANCES[DigitalInput.ESTOP]
    assert hindrance_words(DigitalInput.DRIVER_PROTECT) == HINDRANCES[DigitalInput.DRIVER_PROTECT]
