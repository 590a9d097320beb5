"""Files that a step of a program runs, given in place of a program: each is a program of one step."""

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs.program import Program
from steptwin.host.planning.programs.program_file import SUFFIX, parse_program, verb_of_suffix

_NUMBER: Final = "1"
"""Number of the only step."""


def is_step_file(path: str) -> bool:
    """Return whether the name of a file is that of one that a step runs."""
    ending = Path(path).suffix.lower()
    return ending not in ("", SUFFIX) and ending in verb_of_suffix()


def step_program(name: str, keys: Mapping[str, str] | None = None) -> str:
    """Return the text of the program that runs such a file.

    Args:
        name: the file, from the program's folder on.
        keys: texts of further keys of the step: values of TOML, or texts without quotation marks.
    """
    verb = verb_of_suffix()[Path(name).suffix.lower()]
    lines = [f"{key} = {_value(text)}" for key, text in (keys or {}).items()]
    return "\n".join(["[[step]]", f"{verb} = {_quoted(name)}", *lines, ""])


def read_step_file(path: str, keys: Mapping[str, str]) -> Program:
    """Return the program that runs such a file; raise InputError, with file and place, for what is wrong in it."""
    findings, name = Findings(), Path(path).name
    with prefixed(f"{path}: "), without_step(name):
        program = parse_program(step_program(name, keys), findings, Path(path).parent)
        findings.raise_first()
    return program


@contextmanager
def without_step(name: str) -> Iterator[None]:
    """Leave the place of the only step out of the messages of an InputError in the block."""
    try:
        yield
    except InputError as error:
        raise InputError(*(plain_message(name, message) for message in error.messages)) from error


def plain_message(name: str, message: str) -> str:
    """Return a message about such a program without the place of its only step."""
    verb = verb_of_suffix()[Path(name).suffix.lower()]
    for step in (f"step {_NUMBER} ({verb} {name}): ", f"step {_NUMBER}: "):
        message = message.removeprefix(step)
    return message.removeprefix(f"{name}: ")


def _value(text: str) -> str:
    try:
        tomllib.loads(f"value = {text}")
    except ValueError:
        return _quoted(text)
    return text if "\n" not in text else _quoted(text)


def _quoted(text: str) -> str:
    escaped = "".join(each if each.isprintable() and each not in '"\\' else f"\\U{ord(each):08X}" for each in text)
    return f'"{escaped}"'
