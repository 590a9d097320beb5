"""Compare CSV files and arrays with plain histories."""

import csv as standard_csv
from io import StringIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.record.waveforms import HeldValues, Signal, SignalKind, Window
from steptwin.host.record.waveforms.export import arrays, csv
from tests.host.record.waveforms.made import Made, levels, numbers, pulses

SIGNALS = st.tuples(pulses("a"), levels("a", "dir"), numbers("b"))
WINDOWS = st.tuples(st.integers(0, 30_000), st.integers(1, 20_000)).map(lambda w: Window(w[0], w[0] + w[1], 7_200))


@pytest.mark.slow
@given(made=SIGNALS, window=WINDOWS)
def test_csv_reads_back_as_it_was(made: tuple[Made, ...], window: Window) -> None:
    text = b"".join(csv([one.signal for one in made], window)).decode()
    header, *rows = standard_csv.reader(StringIO(text))
    assert header == ["counts", "t_s", "signal", "value"]
    counts = [int(row[0]) for row in rows]
    assert counts == sorted(counts)
    for row in rows:
        assert float(row[1]) == pytest.approx((int(row[0]) - 7_200) / 72e6, abs=0.51e-9)
    for one in made:
        read = [(int(row[0]), float(row[3])) for row in rows if row[2] == one.signal.name]
        begin = (window.from_counts, one.at(window.from_counts))
        assert read == [begin, *one.changes(window.from_counts, window.to_counts)]


def test_times_have_nine_decimals_and_a_sign() -> None:
    pin = Signal(
        "a", "dir", SignalKind.WIRE, HeldValues(np.array([7_199, 7_201, 72_007_200 + 36]), np.array([1, 0, 1], np.int8))
    )
    text = b"".join(csv([pin], Window(0, 10**8, 7_200))).decode()
    assert text.splitlines()[1:] == [
        "0,-0.000100000,a_dir,0",
        "7199,-0.000000014,a_dir,1",
        "7201,0.000000014,a_dir,0",
        "72007236,1.000000500,a_dir,1",
    ]


@pytest.mark.slow
@given(made=SIGNALS, window=WINDOWS)
def test_arrays_are_the_changes(made: tuple[Made, ...], window: Window) -> None:
    stored = arrays([one.signal for one in made], window)
    ends = [stored[f"{which}_counts"].item() for which in ("from", "to", "start")]
    assert ends == [window.from_counts, window.to_counts, 7_200]
    for one in made:
        name = one.signal.name
        assert stored[f"{name}_initial"] == one.at(window.from_counts)
        pairs = zip(stored[f"{name}_change_counts"].tolist(), stored[f"{name}_values"].tolist(), strict=True)
        assert list(pairs) == one.changes(window.from_counts, window.to_counts)
