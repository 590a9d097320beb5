"""Harms to the wires from a board to a driver: a wire is whole, broken, held at a level, or noisy."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from random import Random
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.features.faults.kinds.harm import AxisOperation, Key, KeyKind, keyed
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.features.faults.kinds.harm import Surroundings

NOISE_RATE_MAX_HZ: Final = 1_000_000


class Wire(StrEnum):
    """A wire from the board to a driver."""

    STEP = "step"
    DIR = "dir"
    ENABLE = "enable"


class WireState(StrEnum):
    """What a wire does with the level of the board's pin."""

    WHOLE = "whole"
    BROKEN = "broken"
    LOW = "low"
    """Shorted to ground."""
    HIGH = "high"
    """Shorted to the logic's supply."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Disturbances of a wire: each turns its level over for a time, at random instants.

    Attributes:
        rate_hz: their number a second in the mean.
        width_ns: duration of each.
        count: number after which the noise ends; None for no end.
        seed: what the instants are drawn from: the pauses are equally likely from 0 to twice their mean.

    Raises:
        ValueError: the rate or the width is not positive, the disturbances do not fit into their rate, or there are
            none.
    """

    rate_hz: float
    width_ns: int
    count: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.rate_hz <= NOISE_RATE_MAX_HZ:
            raise ValueError(f"rate_hz {self.rate_hz:g} is not above 0 and up to {NOISE_RATE_MAX_HZ}")
        if self.width_ns <= 0:
            raise ValueError(f"width_ns {self.width_ns} is not positive")
        if self.pause_counts < 1:
            longest_ns = round(1e9 / self.rate_hz)
            raise ValueError(f"width_ns {self.width_ns} leaves no pause at {self.rate_hz:g} Hz: below {longest_ns}")
        if self.count is not None and self.count < 1:
            raise ValueError(f"count {self.count} is not 1 or more")

    @property
    def width_counts(self) -> int:
        """Duration of each disturbance in counts."""
        return counts_of_ns(self.width_ns)

    @property
    def pause_counts(self) -> int:
        """Mean pause between two of them, in counts."""
        return round(COUNTS_PER_SECOND / self.rate_hz) - self.width_counts

    def flips(self, from_counts: int) -> Iterator[int]:
        """Yield the instants, from one on, when the level turns over: begin and end of each disturbance."""
        random, at, left = Random(self.seed), from_counts, self.count
        while left is None or left > 0:
            at += random.randint(1, 2 * self.pause_counts - 1)
            yield at
            at += self.width_counts
            yield at
            left = None if left is None else left - 1


Condition = WireState | Noise
"""What a wire is like."""


_NOISY: Final = "noisy"
_NOISE_KEYS: Final = (
    Key("rate_hz", KeyKind.NUMBER, "HZ", 0, NOISE_RATE_MAX_HZ, "Hz", optional=True),
    Key("width_us", KeyKind.NUMBER, "US", 0.1, 1e6, "us", parts=1000, optional=True),
    Key("count", KeyKind.WHOLE, "N", 0, optional=True),
    Key("seed", KeyKind.WHOLE, "SEED", 0, optional=True),
)


def _condition(
    state: WireState | None, rate_hz: float | None, width_ns: int | None, count: int | None, seed: int | None
) -> Condition:
    """Return what a wire is like; a state of None is a noisy one."""
    noise = rate_hz, width_ns, count, seed
    if state is not None:
        given = [key.name for key, value in zip(_NOISE_KEYS, noise, strict=True) if value is not None]
        if given:
            raise ValueError(f"{given[0]}: is for a noisy wire, not for one that is {state}")
        return state
    if rate_hz is None or width_ns is None:
        missing = "rate_hz" if rate_hz is None else "width_us"
        raise ValueError(f"{missing}: is missing: a noisy wire has rate_hz and width_us")
    return Noise(rate_hz, width_ns, count, seed or 0)


def _values(condition: Condition) -> tuple[object, ...]:
    """Return the values of the keys of a condition."""
    if isinstance(condition, WireState):
        return condition, None, None, None, None
    return None, condition.rate_hz, condition.width_ns, condition.count, condition.seed or None


@dataclass(frozen=True, slots=True)
class SetWire(AxisOperation):
    """A wire from the board to an axis' driver breaks, is shorted, becomes noisy, or is whole again."""

    do: ClassVar[str] = "wire"
    does: ClassVar[str] = (
        "the wire `step`, `dir` or `enable` to a driver is `broken`, shorted `low` or `high`, `noisy` or `whole`;"
        " a noisy one has `rate_hz` and `width_us`"
    )

    wire: Wire = field(metadata=keyed(Key("wire", KeyKind.WORD, choices={each.value: each for each in Wire})))
    condition: Condition = field(
        metadata=keyed(
            Key("condition", KeyKind.WORD, choices={**{each.value: each for each in WireState}, _NOISY: None}),
            *_NOISE_KEYS,
            join=_condition,
            split=_values,
        )
    )

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Change the wire at the start of the next tick."""
        board.set_wire(self.axis, self.wire, self.condition)

    def undo(self, _before: "Surroundings") -> "SetWire":
        """Return the whole wire."""
        return SetWire(self.axis, self.wire, WireState.WHOLE)

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        """Return what ends it."""
        if values["condition"] == WireState.WHOLE:
            return None
        whole = f"`{cls.do} {values['joint']} {values['wire']} {WireState.WHOLE}`"
        return f"{values['count']} disturbances or {whole}" if "count" in values else whole


WIRES: Final = (SetWire,)
"""The family."""
