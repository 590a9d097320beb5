"""Write the errors that a calibration found into the text of a robot file, and leave all else as it is."""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.robots.link_errors import LinkErrors
from steptwin.host.robots.reader import read_robot
from steptwin.host.robots.robot import Robot

_TABLE: Final = "dh_errors"

_DECIMALS: Final = 7
"""Decimals of an error: a ten thousandth of a micrometre, or 2 nm at the end of an arm of 1 m."""


def corrected_text(robot: Robot, errors: Mapping[str, LinkErrors], comment: str) -> str:
    """Return the text of a robot's file with other errors of its links, each table with a comment in its head.

    Raises:
        InputError: the robot is not from a file, or its file states errors in a form that cannot be replaced.
    """
    if not robot.toml:
        raise InputError("the robot is not from a file: there is no text to correct")
    rounded = {link: _rounded(each) for link, each in errors.items()}
    given = {link: each for link, each in rounded.items() if _sizes(each)}
    tables = (_table(link, each, comment) for link, each in given.items())
    text = "\n".join([f"{_without_errors(robot.toml).rstrip()}\n", *tables])
    if read_robot(text) != replace(robot, dh_errors=given):
        raise InputError(f"{_TABLE}: the errors in the robot's file cannot be replaced")
    return text


def _rounded(errors: LinkErrors) -> LinkErrors:
    return LinkErrors(**{quantity: round(error, _DECIMALS) for quantity, error in asdict(errors).items()})


def _sizes(errors: LinkErrors) -> dict[str, float]:
    return {quantity: error for quantity, error in asdict(errors).items() if error}


def _table(link: str, errors: LinkErrors, comment: str) -> str:
    lines = [f"{quantity} = {error:.{_DECIMALS}f}\n" for quantity, error in _sizes(errors).items()]
    return "".join([f"[{_TABLE}.{link}] # {comment}\n", *lines])


def _without_errors(text: str) -> str:
    """Return the text without the tables of errors, each from its head to the next head."""
    kept, inside = [], False
    for line in text.splitlines(keepends=True):
        head = line.strip()
        if head.startswith("["):
            inside = head.startswith((f"[{_TABLE}]", f"[{_TABLE}."))
        if not inside:
            kept.append(line)
    rest = "".join(kept)
    if _TABLE in tomllib.loads(rest):
        raise InputError(f"{_TABLE}: stands in a line of its own; only tables such as [{_TABLE}.link1] can be replaced")
    return rest
