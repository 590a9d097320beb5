"""Harms to the wires from a board to a driver: a wire is whole, broken, held at a level, or noisy."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.emulator.drivers.axis_wires import NOISE_RATE_MAX_HZ, Condition, Noise, Wire, WireState
from steptwin.features.faults.kinds.harm import AxisHarm, Key, KeyKind, keyed

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.environment import BoardEnvironment

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
class SetWire(AxisHarm):
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

    def undo(self, _before: "BoardEnvironment") -> "SetWire":
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
