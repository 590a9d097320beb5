"""Every format gives the signals that were recorded, and what is damaged is refused in a line."""

import shutil
import struct
import subprocess
import zipfile
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.features.captures.capture import Capture, Channel
from steptwin.features.captures.channel_map import capture_facts
from steptwin.features.captures.reading import read_capture
from steptwin.host.common.errors import InputError
from tests.features.captures.analyser import Probe, write_changes, write_saleae, write_session
from tests.messages import refusing

SIGROK = shutil.which("sigrok-cli")
RATE_HZ = 1e6


def some_probes(count: int = 3) -> list[Probe]:
    """STEP with 40 pulses of 33 us, DIR that turns once between two of them, and channels that count on."""
    rises = 0.01 + np.arange(40, dtype=np.float64) * 1e-3
    step = np.column_stack([rises, rises + 33e-6]).ravel()
    direction = rises[20:21] - 5e-4
    return [
        Probe("th1_step", 0, step),
        Probe("th1_dir", 1, direction),
        *(Probe(f"other {n}", n & 1, rises[:n] + 1e-5) for n in range(count - 2)),
    ]


def check(capture: Capture, probes: list[Probe], within_s: float) -> None:
    """The channels have the probes' first levels and edges."""
    assert [channel.level for channel in capture.channels] == [probe.level for probe in probes]
    for channel, probe in zip(capture.channels, probes, strict=True):
        times_s = capture.times_s(channel.edges)
        assert times_s.size == probe.times_s.size
        assert np.abs(times_s - probe.times_s).max(initial=0.0) <= within_s


@pytest.mark.parametrize("count", [3, 8, 9, 16, 17, 24, 33])
def test_a_session_with_any_number_of_probes(count: int, tmp_path: Path) -> None:
    """24 probes take 3 bytes a sample, 33 take 5; parts of 1000 bytes end within a sample, and 10 comes after 9."""
    probes = some_probes(count)
    capture = read_capture(write_session(tmp_path / "a.sr", probes, RATE_HZ, part_bytes=1000))
    check(capture, probes, 0.5001e-6)
    assert (capture.kind, capture.rate_hz) == ("sigrok session", RATE_HZ)
    assert [channel.name for channel in capture.channels] == [probe.name for probe in probes]


def test_a_dump_with_several_changes_in_a_line_and_codes_of_digits(tmp_path: Path) -> None:
    path = tmp_path / "a.vcd"
    path.write_text(
        "$date today $end $comment Acquisition with 3/3 channels at 24 MHz $end $timescale 100 ps $end\n"
        "$scope module x $end $var wire 1 0 D0 $end $var wire 1 1 D1 $end $var wire 8 b bus $end $upscope $end\n"
        "$enddefinitions $end\n#1000 00 11 b101 b\n#1417 10 01\n"
        "#2000 $comment 10 is no change here $end 00 x1\n#5000\n",
        encoding="ascii",
    )
    capture = read_capture(path)
    assert capture.rate_hz == 24e6
    assert capture.duration_s == pytest.approx(400e-9)
    assert [(each.name, each.level, each.edges.tolist()) for each in capture.channels] == [
        ("D0", 0, [417, 1000]),
        ("D1", 1, [417]),
    ]


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        ("Time [s],Channel 0,Channel 1,Channel 2\n", "Saleae's CSV"),
        ("# Digilent WaveForms\n# Sample rate: 1e6Hz\n\nTime (s),DIO 0,DIO 1,DIO 2\n", "WaveForms' CSV"),
    ],
)
def test_a_table_with_a_row_a_change(head: str, kind: str, tmp_path: Path) -> None:
    probes = some_probes()
    capture = read_capture(write_changes(tmp_path / "a.csv", probes, head.replace("\n\n", "\n")), "1MHz")
    assert capture.kind == kind
    check(capture, probes, 1e-9)
    assert capture.rate_hz == RATE_HZ


def test_logic_2s_binary_export(tmp_path: Path) -> None:
    probes = some_probes(12)
    capture = read_capture(write_saleae(tmp_path / "export", probes, 0.06))
    check(capture, probes, 1e-9)
    assert [channel.name for channel in capture.channels][9:] == ["digital_9", "digital_10", "digital_11"]
    with refusing(InputError):
        capture.resolution_s  # noqa: B018 - a property that raises
    assert read_capture(tmp_path / "export" / "digital_0.bin").channels[0].edges.size == 80


@pytest.mark.skipif(SIGROK is None, reason="sigrok-cli is not installed")
@pytest.mark.parametrize("kind", ["vcd", "csv", "csv:time=true", "csv:dedup=true:time=true", "srzip"])
def test_what_sigrok_writes(kind: str, tmp_path: Path) -> None:
    probes = some_probes(9)
    session = write_session(tmp_path / "a.sr", probes, RATE_HZ)
    out = tmp_path / ("b.sr" if kind == "srzip" else "b")
    subprocess.run([SIGROK or "", "-i", str(session), "-O", kind, "-o", str(out)], check=True, timeout=60)
    capture = read_capture(out)
    check(capture, probes, 1.0001e-6)
    assert capture.rate_hz == RATE_HZ


def test_what_it_holds(tmp_path: Path) -> None:
    facts = capture_facts(read_capture(write_session(tmp_path / "a.sr", some_probes(), RATE_HZ)))
    step = facts["channels"][0]
    assert (step["edges"], step["first_level"]) == (80, 0)
    assert step["shortest_pulse_us"] == pytest.approx(33.0, abs=1.001)
    assert step["fastest_hz"] == pytest.approx(1000.0, rel=0.002)
    assert facts["pairs"] == [{"step": "th1_step", "dir": "th1_dir"}]


@pytest.mark.parametrize("stems", [("th2", "th1"), ("", "")])
def test_a_name_tells_a_pair_where_two_look_alike(stems: tuple[str, str]) -> None:
    """Both DIRs change between two pulses, the other axis' stands nearer. Without names the nearer one counts."""
    step = Channel("th1_step" if stems[0] else "D1", 0, np.arange(80) * 50 + 100)
    dirs = [Channel(f"{stem}_dir" if stem else f"D{4 + i}", 0, np.array([2160])) for i, stem in enumerate(stems)]
    pairs = capture_facts(Capture("test", (step, *dirs), 1e-6, 10_000, None))["pairs"]
    assert [pair["dir"] for pair in pairs] == ["th1_dir" if stems[0] else "D4"]


# --- what is damaged


def zipped(**files: bytes) -> bytes:
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for name, data in files.items():
            made.writestr(name.replace("_", "-"), data)
    return stream.getvalue()


GOOD = b"[device 1]\ncapturefile=logic-1\nsamplerate=1 MHz\nprobe1=a\nunitsize=1\n"
DAMAGED = {
    "a zip of something else": (zipped(readme=b"x"), "it has no metadata"),
    "no samples": (zipped(metadata=GOOD), "has no part logic-1-1"),
    "a unit of 9 bytes": (zipped(metadata=GOOD.replace(b"size=1", b"size=9"), logic_1_1=b"\0"), "unitsize 9 is not"),
    "a rate of words": (zipped(metadata=GOOD.replace(b"1 MHz", b"fast"), logic_1_1=b"\0"), "a sampling rate of 'fast'"),
    "no probes": (zipped(metadata=GOOD.replace(b"probe1=a", b""), logic_1_1=b"\0"), "has 0 channels"),
    "a dump without a time": (b"$var wire 1 ! a $end $enddefinitions $end", "has no $timescale"),
    "time that goes back": (
        b"$timescale 1 us $end $var wire 1 ! a $end $enddefinitions $end\n#5 1!\n#4 0!",
        "#4: comes after #5",
    ),
    "a strange scale": (b"$timescale 3 us $end $enddefinitions $end", "$timescale 3 us: is not 1, 10 or 100"),
    "a table of others": (b"a,b\n1,2\n", "is no capture: neither"),
    "a level of 2": (b"Time [s],a\n0,0\n1,2\n", "row 2: has a level that is not 0 or 1"),
    "a short row": (b"Time [s],a,b\n0,0,1\n1,1\n", "from row 1 on"),
    "rows that go back": (b"Time [s],a\n1,0\n0,1\n", "row 2: its time 0 s is before"),
    "bytes": (bytes(range(128, 256)), "is none of sigrok's"),
    "another version of Logic 2": (b"<SALEAE>" + struct.pack("<iiIddQ", 1, 0, 0, 0, 1, 0), "is version 1, type 0"),
    "a promise": (b"<SALEAE>" + struct.pack("<iiIddQ", 0, 0, 0, 0, 1, 5), "says 5 changes, but has 0"),
    "nothing": (b"", "is no capture"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_it_is_refused_in_a_line(name: str, tmp_path: Path) -> None:
    data, why = DAMAGED[name]
    path = tmp_path / "a.sr"
    path.write_bytes(data)
    with pytest.raises(InputError) as error:
        read_capture(path)
    assert str(error.value).startswith(f"{path}: ")
    assert why in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    begin=st.sampled_from(
        [b"", b"$timescale 1 us $end\n", b"Time [s],a,b\n", b"<SALEAE>", b"PK\x03\x04", b"; Samplerate: 1 MHz\n"]
    ),
    rest=st.binary(max_size=200) | st.text("01,.#!$ae\n ", max_size=200).map(str.encode),
)
def test_junk_is_refused_or_read(begin: bytes, rest: bytes, tmp_path: Path) -> None:
    path = tmp_path / "junk"
    path.write_bytes(begin + rest)
    with suppress(InputError):
        assert isinstance(read_capture(path), Capture)


def test_a_file_that_is_not_there_and_a_rate_that_is_told() -> None:
    with refusing(InputError):
        read_capture("none.sr")


@pytest.mark.parametrize(("text", "refused"), [("1 MHz", False), ("1000 kHz", False), ("8MHz", True)])
def test_a_rate_is_for_files_that_do_not_tell_it(text: str, refused: bool, tmp_path: Path) -> None:
    path = write_session(tmp_path / "a.sr", some_probes(), RATE_HZ)
    if refused:
        with refusing(InputError):
            read_capture(path, text)
    else:
        assert read_capture(path, text).rate_hz == RATE_HZ
