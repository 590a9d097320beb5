"""Checks of a node: what each asks, and its result."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from steptwin.features.conform.node import NodeUnderTest, Traffic


class CheckResult(StrEnum):
    """CheckResult of a check."""

    PASSED = "pass"
    FAILED = "FAIL"
    DIFFERS = "differs"
    """Allowed, but not the usual answer."""
    SKIPPED = "skip"
    """The node does not have what is checked, or the check is not allowed."""


class Need(Enum):
    """What a check needs beyond a bus; the value says how to give it."""

    NOTHING = ""
    EDS = "--eds FILE"
    ENABLE = "--enable: the drive is switched on, without motion"
    MOTION = "--motion: the axis moves"


class FailedError(Exception):
    """The node does not do what the clause says; the message is one line."""


class DiffersError(Exception):
    """The node does what the clause allows, but other nodes do not; the message is one line."""


class SkippedError(Exception):
    """The node does not have what is checked; the message is one line."""


def expect(holds: object, reason: str) -> None:
    """Raise FailedError unless a condition holds."""
    if not holds:
        raise FailedError(reason)


@dataclass(frozen=True, slots=True)
class ConformanceCheck:
    """One check.

    Attributes:
        id: its short name: the group's letter and a number.
        group: what it belongs to, as CiA's conformance test groups it.
        clause: section of CiA 301, or object of CiA 402.
        title: what the node is asked and what it must answer.
        need: what it needs.
        run: asks the node; raises FailedError, DiffersError or SkippedError.
    """

    id: str
    group: str
    clause: str
    title: str
    need: Need
    run: "Callable[[NodeUnderTest], None]"


@dataclass(frozen=True, slots=True)
class Checked:
    """A check that has been done.

    Attributes:
        check: the check.
        result: its result.
        reason: why it has not simply passed; empty otherwise.
        traffic: frames of the check, in order.
    """

    check: ConformanceCheck
    result: CheckResult
    reason: str
    traffic: "tuple[Traffic, ...]"


CHECKS: Final[list[ConformanceCheck]] = []
"""All checks, in the order in which a node meets them; the modules of the groups add theirs when they are imported."""


def group(name: str, need: Need = Need.NOTHING) -> Callable[..., Callable[..., "Callable[[NodeUnderTest], None]"]]:
    """Return what adds the checks of a group: a decorator with id, clause and title."""

    def check(
        name_of_check: str, clause: str, title: str, need: Need = need
    ) -> "Callable[[Callable[[NodeUnderTest], None]], Callable[[NodeUnderTest], None]]":
        def add(run: "Callable[[NodeUnderTest], None]") -> "Callable[[NodeUnderTest], None]":
            CHECKS.append(ConformanceCheck(name_of_check, name, clause, title, need, run))
            return run

        return add

    return check
