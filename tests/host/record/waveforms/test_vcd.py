"""Read VCD files back with a reader that shares nothing with the writer: changes, instants, initial values."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.record.waveforms import (
    SCALES,
    Format,
    HeldValues,
    Pulses,
    Signal,
    SignalKind,
    Window,
    write_waveform,
)
from steptwin.host.record.waveforms.export import vcd
from steptwin.host.record.waveforms.signal import CHANGES_PER_STRETCH
from tests.host.record.waveforms.made import LAST_COUNTS, TEXTS, Made, levels, numbers, pulses, texts
from tests.host.record.waveforms.vcd_reader import Dump, read_vcd

APART = 72
"""Distance of a wire's edges in counts: so far apart they have different instants in every time scale."""

WIRES = st.tuples(pulses("a", APART), levels("a", "dir", APART), pulses("b", APART), levels("b", "dir", APART))
WINDOWS = st.tuples(st.integers(0, 30_000), st.integers(1, 20_000)).map(lambda w: Window(w[0], w[0] + w[1], 7_200))


def dump_of(signals: list[Signal], window: Window, scale: str = "1us") -> Dump:
    return read_vcd(b"".join(vcd(signals, window, SCALES[scale], "arm job")).decode("ascii"))


@pytest.mark.slow
@pytest.mark.parametrize("scale", SCALES)
@given(made=WIRES, window=WINDOWS)
def test_wires_read_back_as_they_were(scale: str, made: tuple[Made, ...], window: Window) -> None:
    dump = dump_of([one.signal for one in made], window, scale)
    assert dump.timescale.replace(" ", "") == scale
    unit = SCALES[scale].unit
    for one in made:
        name = one.signal.name
        assert dump.types[name] == "wire 1"
        assert dump.initial[name] == str(one.at(window.from_counts))
        expected = [(unit(counts), str(value)) for counts, value in one.changes(window.from_counts, window.to_counts)]
        assert dump.changes[name] == expected
    assert (dump.instants[0], dump.instants[-1]) == (unit(window.from_counts), unit(window.to_counts))


@pytest.mark.slow
@given(made=st.tuples(numbers("a"), texts("b")), window=WINDOWS)
def test_numbers_and_texts_read_back_as_they_were(made: tuple[Made, Made], window: Window) -> None:
    """The file holds the last of several values at one of its instants."""
    number, text = made
    dump = dump_of([one.signal for one in made], window, "100ns")
    assert (dump.types["a_position_mm"], dump.types["b_drive_state"]) == ("real 64", "string 1")
    for one, read in ((number, float), (text, TEXTS.index)):
        name = one.signal.name
        assert read(dump.initial[name]) == one.at(window.from_counts)
        expected = {}
        for counts, value in one.changes(window.from_counts, window.to_counts):
            expected[SCALES["100ns"].unit(counts)] = value
        assert [(instant, read(value)) for instant, value in dump.changes[name]] == list(expected.items())


@pytest.mark.slow
def test_many_edges_in_many_stretches() -> None:
    """Three axes, one of them at rest in between, have half a million edges: none is lost or doubled at a border."""
    rng = np.random.default_rng(1)
    rises = [np.cumsum(rng.integers(5_000, 9_000, 2 * CHANGES_PER_STRETCH // 3)) for _ in range(3)]
    rises[1] = rises[1][(rises[1] < 10**8) | (rises[1] > 2 * 10**8)]
    signals = [Signal(f"a{i}", "step", SignalKind.WIRE, Pulses(own, own + 2_376)) for i, own in enumerate(rises)]
    dump = dump_of(signals, Window(0, 10**9, 0), "10ns")
    for own, name in zip(rises, ("a0_step", "a1_step", "a2_step"), strict=True):
        edges = np.column_stack([own, own + 2_376]).ravel()
        instants = np.array([instant for instant, _ in dump.changes[name]])
        np.testing.assert_array_equal(np.rint(instants * 0.72), edges)
        assert [value for _, value in dump.changes[name][:3]] == ["1", "0", "1"]


def test_a_change_at_the_beginning_is_an_initial_value_and_a_change_at_the_end_is_shown() -> None:
    pin = Signal("a", "dir", SignalKind.WIRE, HeldValues(np.array([720, 7_200, 14_400]), np.array([1, 0, 1], np.int8)))
    dump = dump_of([pin], Window(720, 14_400, 0))
    assert dump.initial["a_dir"] == "1"
    assert dump.changes["a_dir"] == [(100, "0"), (200, "1")]
    dump = dump_of([pin], Window(719, 14_399, 0))
    assert dump.initial["a_dir"] == "0"
    assert dump.changes["a_dir"] == [(10, "1"), (100, "0")]


class TestAPulseTooShortForTheScale:
    def pin(self, width_counts: int) -> list[Signal]:
        return [Signal("th1", "step", SignalKind.WIRE, Pulses(np.array([36]), np.array([36 + width_counts])))]

    def test_is_refused(self) -> None:
        with pytest.raises(InputError) as caught:
            dump_of(self.pin(71), Window(0, 1_000, 72_036))
        assert str(caught.value) == (
            "th1_step: changes twice within 0.986 us at t = -0.001000 s, too fast for a time scale of"
            " 1 us: choose a finer one"
        )

    def test_is_shown_when_it_is_a_unit_long(self) -> None:
        assert dump_of(self.pin(72), Window(0, 1_000, 0)).changes["th1_step"] == [(1, "1"), (2, "0")]

    def test_is_shown_in_a_finer_scale(self) -> None:
        assert dump_of(self.pin(1), Window(0, 1_000, 0), "10ns").changes["th1_step"] == [(50, "1"), (51, "0")]

    @pytest.mark.parametrize(("width_counts", "scale"), [(72, "1 us"), (71, "100 ns"), (3, "10 ns"), (1, "10 ns")])
    def test_makes_a_file_without_a_given_scale_finer(self, width_counts: int, scale: str, tmp_path: Path) -> None:
        path = tmp_path / "trace.vcd"
        write_waveform(path, self.pin(width_counts), Window(0, 1_000, 0), Format.VCD, "")
        assert f"$timescale {scale} $end" in path.read_text()

    def test_leaves_no_file(self, tmp_path: Path) -> None:
        path = tmp_path / "trace.vcd"
        with pytest.raises(InputError):
            write_waveform(path, self.pin(5), Window(0, 1_000, 0), Format.VCD, "", SCALES["1us"])
        assert not path.exists()


def test_a_pulse_without_length_is_left_out() -> None:
    """The firmware resets a driver within one count of the timer."""
    pin = Signal("a", "reset", SignalKind.WIRE, HeldValues(np.array([100, 900, 900]), np.array([1, 0, 1], np.int8)))
    assert dump_of([pin], Window(0, LAST_COUNTS, 0)).changes["a_reset"] == [(1, "1")]


def test_the_header_names_the_run_and_the_instant_zero() -> None:
    pin = Signal("th 1", "dir", SignalKind.WIRE, HeldValues(np.array([720]), np.array([1], np.int8)))
    text = b"".join(vcd([pin], Window(0, 72_000, 36_000), SCALES["1us"], "arm $end job")).decode()
    dump = read_vcd(text)
    assert dump.texts == ["StepTwin, SIMULATED: arm end job", "#0 is power-up, #500 the motion's t = 0"]
    assert dump.scopes == {"th_1_dir": "th_1"}


def test_codes_of_many_signals_are_different_and_printable() -> None:
    signals = [
        Signal(f"a{i}", "dir", SignalKind.WIRE, HeldValues(np.array([720 + i]), np.array([1], np.int8)))
        for i in range(200)
    ]
    dump = dump_of(signals, Window(0, 7_200, 0))
    assert len(dump.types) == 200
    assert all(dump.changes[f"a{i}_dir"] == [((720 + i + 36) // 72, "1")] for i in range(200))


def test_a_window_without_changes_has_a_beginning_and_an_end() -> None:
    dump = dump_of(
        [Signal("a", "dir", SignalKind.WIRE, HeldValues(np.array([5]), np.array([1], np.int8)))], Window(720, 7_200, 0)
    )
    assert (dump.initial, dump.instants) == ({"a_dir": "1"}, [10, 100])
