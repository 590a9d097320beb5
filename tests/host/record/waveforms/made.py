"""Draw signals at random, each with the plain history that it stands for."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from steptwin.host.record.waveforms import HeldValues, Pulses, Signal, SignalKind

LAST_COUNTS = 40_000


@dataclass(frozen=True)
class Made:
    """A signal and its history in plain numbers: the first value, then instants with the value from there on."""

    signal: Signal
    before: float
    history: list[tuple[int, float]]

    def at(self, counts: int) -> float:
        return ([self.before] + [value for instant, value in self.history if instant <= counts])[-1]

    def changes(self, after: int, until: int) -> list[tuple[int, float]]:
        """Return the instants at which the value changes, each instant once."""
        instants = sorted({instant for instant, _ in self.history if after < instant <= until})
        return [(instant, self.at(instant)) for instant in instants if self.at(instant) != self.at(instant - 1)]


def instants(apart: int = 0, most: int = 60) -> st.SearchStrategy[list[int]]:
    """Draw sorted instants that are at least `apart` counts apart."""
    return st.lists(st.integers(0, LAST_COUNTS), max_size=most).map(
        lambda values: [value + apart * i for i, value in enumerate(sorted(values))]
    )


@st.composite
def pulses(draw: st.DrawFn, axis: str, apart: int = 1) -> Made:
    """Draw a STEP pin whose edges are at least `apart` counts apart."""
    edges = draw(instants(apart))
    edges = edges[: len(edges) // 2 * 2]
    changes = Pulses(np.array(edges[0::2], np.int64), np.array(edges[1::2], np.int64))
    return Made(Signal(axis, "step", SignalKind.WIRE, changes), 0, [(edge, 1 - i % 2) for i, edge in enumerate(edges)])


@st.composite
def levels(draw: st.DrawFn, axis: str, pin: str, apart: int = 0) -> Made:
    """Draw a pin that is held at a level; levels may repeat, and change several times at one instant."""
    counts = draw(instants(apart))
    values = draw(st.lists(st.integers(0, 1), min_size=len(counts), max_size=len(counts)))
    changes = HeldValues(np.array(counts, np.int64), np.array(values, np.int8))
    return Made(Signal(axis, pin, SignalKind.WIRE, changes), 0, list(zip(counts, values, strict=True)))


@st.composite
def numbers(draw: st.DrawFn, axis: str) -> Made:
    counts = draw(instants())
    finite = st.floats(allow_nan=False, allow_infinity=False)
    values = draw(st.lists(finite, min_size=len(counts), max_size=len(counts)))
    before = draw(finite)
    changes = HeldValues(np.array(counts, np.int64), np.array(values, np.float64), before)
    return Made(Signal(axis, "position_mm", SignalKind.REAL, changes), before, list(zip(counts, values, strict=True)))


TEXTS = ("UNKNOWN", "READY", "FAULT")


@st.composite
def texts(draw: st.DrawFn, axis: str) -> Made:
    counts = draw(instants())
    values = draw(st.lists(st.integers(0, 2), min_size=len(counts), max_size=len(counts)))
    changes = HeldValues(np.array(counts, np.int64), np.array(values, np.int8))
    return Made(Signal(axis, "drive_state", SignalKind.TEXT, changes, TEXTS), 0, list(zip(counts, values, strict=True)))
