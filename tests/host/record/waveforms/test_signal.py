"""Compare signals with their plain histories."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.record.waveforms import SCALES, HeldValues, Pulses, Signal, SignalKind, TimeScale, Window
from steptwin.host.record.waveforms.signal import CHANGES_PER_STRETCH, COUNTS, stretches
from tests.host.record.waveforms.made import LAST_COUNTS, Made, levels, numbers, pulses, texts

ANY_SIGNAL = st.one_of(pulses("a"), levels("a", "dir"), numbers("a"), texts("a"))
INSTANT = st.integers(0, LAST_COUNTS + 100)


@pytest.mark.slow
@given(made=ANY_SIGNAL, counts=INSTANT)
def test_the_value_at_an_instant_includes_a_change_at_it(made: Made, counts: int) -> None:
    assert made.signal.changes.at(counts) == made.at(counts)


@pytest.mark.slow
@given(made=ANY_SIGNAL, ends=st.tuples(INSTANT, INSTANT).map(sorted))
def test_changes_between_two_instants(made: Made, ends: list[int]) -> None:
    counts, values = made.signal.changes.between(*ends)
    assert list(zip(counts.tolist(), values.tolist(), strict=True)) == made.changes(*ends)


@pytest.mark.slow
@given(made=ANY_SIGNAL, counts=INSTANT)
def test_the_changes_before_and_after_an_instant(made: Made, counts: int) -> None:
    earlier, later = made.changes(-1, counts - 1), made.changes(counts, LAST_COUNTS + 10_000)
    assert made.signal.changes.before(counts) == (earlier[-1][0] if earlier else None)
    assert made.signal.changes.after(counts) == (later[0][0] if later else None)


@pytest.mark.slow
@given(made=ANY_SIGNAL, every=st.integers(2, 9))
def test_marks_bound_the_number_of_changes(made: Made, every: int) -> None:
    borders = [-1, *made.signal.changes.marks(every).tolist(), LAST_COUNTS + 10_000]
    for after, until in pairwise(borders):
        assert len(made.changes(after, until - 1)) <= every


@pytest.mark.parametrize("scale", [*SCALES.values(), COUNTS], ids=[*SCALES, "counts"])
def test_stretches_cover_the_window_without_dividing_a_unit(scale: TimeScale) -> None:
    rises = 100 + 150 * np.arange(4 * CHANGES_PER_STRETCH)
    signals = [Signal("a", "step", SignalKind.WIRE, Pulses(rises, rises + 75))]
    signals += [
        Signal("a", "dir", SignalKind.WIRE, HeldValues(rises[::3] - 17, np.arange(len(rises[::3]), dtype=np.int8) % 2))
    ]
    window = Window(5, int(rises[-1]) + 30, 0)
    parts = list(stretches(signals, window, scale))
    assert parts[0][0] == window.from_counts
    assert parts[-1][1] == window.to_counts
    assert [until for _, until in parts[:-1]] == [after for after, _ in parts[1:]]
    assert 8 <= len(parts) <= 12
    for _, until in parts[:-1]:
        assert scale.unit(until) < scale.unit(until + 1)


def test_names_have_letters_digits_and_underscores_only() -> None:
    signal = Signal("ä 1.$end", "step", SignalKind.WIRE, Pulses(np.empty(0, np.int64), np.empty(0, np.int64)))
    assert (signal.scope, signal.name) == ("__1__end", "__1__end_step")
