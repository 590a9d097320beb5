"""What captures hold beside wires is counted and told; numbers and names that would cost hours are refused before."""

import struct
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

from steptwin.features.captures.binary_files import MAGIC
from steptwin.features.captures.capture import Capture, Channel
from steptwin.features.captures.channel_map import capture_facts
from steptwin.features.captures.reading import read_capture
from steptwin.host.common.errors import InputError
from steptwin.host.verify.clock_fit import fit_clock
from steptwin.host.verify.clock_line import CapturedSteps
from steptwin.host.verify.oracle import IdealSteps

HEAD = (
    "$timescale 1 ns $end $var wire 1 ! step $end $var wire 1 ? dir $end $var wire 8 b bus $end $enddefinitions $end\n"
)


def read(path: Path, text: str | bytes) -> Capture:
    """Read a file of this text; no warning may come."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_capture(path)


def refused(path: Path, text: str | bytes) -> str:
    with pytest.raises(InputError) as error:
        read(path, text)
    assert "\n" not in str(error.value)
    return str(error.value).removeprefix(f"{path}: ")


def test_wires_of_one_bit_that_are_written_as_vectors(tmp_path: Path) -> None:
    capture = read(tmp_path / "a.vcd", HEAD + "#0 b0 ! 0?\n#40 b1 !\n#80 b00 !\n#120 1!\n#200 B0 !\n")
    assert [(each.name, each.edges.tolist()) for each in capture.channels] == [
        ("step", [40, 80, 120, 200]),
        ("dir", []),
    ]
    assert capture.told == ("1 variables that are no wire of one bit are left out",)


def test_what_is_left_out_of_a_dump_is_counted(tmp_path: Path) -> None:
    capture = read(tmp_path / "a.vcd", HEAD + "#0 b0 b 0! 0?\n#40 b101 b r1.5 ! u!\n#80 x? 1! 1zz\n")
    assert capture.told == (
        "3 changes of variables that are no wire of one bit are left out",
        "2 changes of wires to a level that is none of 0, 1, x and z are left out",
        "1 variables that are no wire of one bit are left out",
        "1 changes to x or z are taken for low",
    )
    assert capture_facts(capture)["told"] == list(capture.told)


@pytest.mark.parametrize(
    ("instants", "rate_hz"), [("#0 0!\n#400 1!\n#1000 0!\n", 5e6), ("#0 0!\n#41 1!\n#83 0!\n", None)]
)
def test_a_dump_without_a_rate_has_that_of_its_grid_or_none(
    instants: str, rate_hz: float | None, tmp_path: Path
) -> None:
    """Edges at 0, 400 and 1000 ns lie on a grid of 200 ns; those at 41 and 83 ns on the time scale alone."""
    capture = read(tmp_path / "a.vcd", HEAD + instants)
    assert capture.rate_hz == (None if rate_hz is None else pytest.approx(rate_hz))
    if rate_hz is None:
        with pytest.raises(InputError, match="does not tell its sampling rate: rate=24MHz says it"):
            capture.resolution_s  # noqa: B018 - a property that raises


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("Time [s],a\n0,0\n1,X\n", "row 2: 'X' in column 2 is no number: the channel was not recorded then"),
        ("Time [s],a\n2026-11-29T01:02:03Z,0\n", "row 1: '2026-11-29T01:02:03Z' in column 1 is no number, but a date"),
        ("Time [s],a\n0,0\n1,nan\n", "row 2: 'nan' in column 2 is no number"),
        ("Time [s],a\n0,0\n1e300,1\n", "lasts 1e+300 s: at most 1e+09 s, 31 years, can be read"),
        ("Time [s],a\n-1e308,0\n1e308,1\n", "lasts inf s: at most"),
        ("; Channels (1/1): a\n; Samplerate: 1 MHz\nmicroseconds,a\n1e300,0\n", "lasts 1e+294 s: at most"),
        (HEAD.replace("1 ns", "1 s") + "#0 0!\n#999999999999999999 1!\n", "lasts 1e+18 s: at most"),
        (MAGIC + struct.pack("<iiIddQd", 0, 0, 0, 0.0, 1e300, 1, 1e299), "lasts 1e+300 s: at most"),
    ],
)
def test_cells_and_instants_that_are_none_are_refused_in_a_sentence(
    text: str | bytes, why: str, tmp_path: Path
) -> None:
    assert refused(tmp_path / "a", text).startswith(why)


def test_many_wires_of_one_code_are_refused_at_the_first_too_many(tmp_path: Path) -> None:
    head = "$timescale 1 ns $end " + "".join(f"$var wire 1 ! w{n} $end " for n in range(65)) + "$enddefinitions $end\n"
    assert refused(tmp_path / "a.vcd", head + "#0 0!\n") == "has 65 channels; 1 to 64 can be read"


def session(path: Path, *, again: int, same_name: bool) -> Path:
    """Write a session whose directory names one part again and again."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("metadata", "[device 1]\ncapturefile=logic-1\nsamplerate=1 MHz\nprobe1=a\nunitsize=1\n")
        made.writestr("logic-1-1", bytes(1 << 16))
        part = made.infolist()[-1]
        for number in range(again):
            copy = zipfile.ZipInfo(part.filename if same_name else f"logic-1-{number + 2}")
            for name in ("header_offset", "file_size", "compress_size", "compress_type", "CRC"):
                setattr(copy, name, getattr(part, name))
            made.filelist.append(copy)
    return path


@pytest.mark.parametrize(
    ("same_name", "why"),
    [(True, "names a part of the record twice"), (False, "names the same data for several parts")],
)
def test_a_session_that_names_a_part_again_is_refused_before_it_is_read(
    same_name: bool, why: str, tmp_path: Path
) -> None:
    path = session(tmp_path / "a.sr", again=50, same_name=same_name)
    with pytest.raises(InputError, match=why):
        read_capture(path)


def test_the_search_grows_with_the_steps_and_not_with_the_last_instant() -> None:
    """One more step 28 hours later once took 6 GB."""
    times_s = np.cumsum(np.concatenate([np.linspace(0.02, 0.001, 40), np.linspace(0.001, 0.02, 40)]))
    signs = np.ones(80, np.int8)
    ideal = IdealSteps(0, times_s, signs, np.gradient(np.arange(80.0), times_s), times_s[-1:])
    late = CapturedSteps(np.append(times_s + 1.0, 1e5), np.append(signs, np.int8(1)))
    clock = fit_clock([ideal], [late])
    assert clock.found
    assert clock.offset_s == pytest.approx(1.0, abs=1e-6)
    before = CapturedSteps(np.append(0.5, times_s + 1e5), np.append(np.int8(1), signs))
    assert fit_clock([ideal], [before]).offset_s == pytest.approx(1e5, abs=1e-4)


def test_two_channels_that_may_be_dir_are_told() -> None:
    steps = [Channel(f"{2 * i}", 0, np.arange(80) * 50 + 100 + 7 * i) for i in range(2)]
    turns = [Channel(f"{2 * i + 1}", 0, np.array([2190 + i])) for i in range(2)]
    capture = Capture("test", (steps[0], turns[0], steps[1], turns[1]), 1e-6, 10_000, 1e6)
    assert capture_facts(capture)["pairs"] == [
        {"step": "0", "dir": "1", "or": ["3"]},
        {"step": "2", "dir": "3", "or": ["1"]},
    ]
