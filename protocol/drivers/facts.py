"""Facts about drivers, each with where it is from: a source's own words, another file's quotation, or a guess."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Grade(StrEnum):
    """How a fact is known."""

    STATED = "stated"
    """Read in the source itself."""
    QUOTED = "quoted"
    """Another file quotes the source, which itself was not read."""
    ASSUMED = "assumed"
    """No source says so; in the source's place stands the reason."""


@dataclass(frozen=True, slots=True)
class Fact(Generic[Value]):
    """A value with its source: document, revision and place."""

    value: Value
    source: str
    grade: Grade = Grade.STATED


def quoted(value: Value, source: str) -> Fact[Value]:
    """Return a fact that is known from a quotation."""
    return Fact(value, source, Grade.QUOTED)


def assumed(value: Value, reason: str) -> Fact[Value]:
    """Return a fact that no source states."""
    return Fact(value, reason, Grade.ASSUMED)
