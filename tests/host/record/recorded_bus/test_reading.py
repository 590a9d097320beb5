"""Recordings in every format, and files that are none."""

import gzip
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.record import recorded_bus as reading
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.recorded_bus import FORMATS, read_bus
from steptwin.protocol.frame import Frame
from tests.messages import refusing

FRAMES = [
    can.Message(1_700_000_000.000100, 0x000, is_extended_id=False, data=[1, 0], is_rx=False, channel=0),
    can.Message(1_700_000_000.000350, 0x190, is_extended_id=False, data=[0x40, 2, 0, 1, 2, 3, 4], channel=0),
    can.Message(1_700_000_000.250000, 0x080, is_extended_id=False, data=[], is_rx=False, channel=0),
    can.Message(1_700_000_001.500000, 0x610, is_extended_id=False, data=range(8), is_rx=False, channel=0),
]
OTHERS = [
    can.Message(1_700_000_002.0, 0x18FEF100, is_extended_id=True, data=[1], channel=0),
    can.Message(1_700_000_002.0, 0x190, is_extended_id=False, is_remote_frame=True, dlc=4, channel=0),
    can.Message(1_700_000_002.0, is_error_frame=True, channel=0),
]
GOOD = log_line(72_000, Frame(0x181, b"\x01"))


def written(path: Path, messages: list[can.Message]) -> Path:
    with can.Logger(path) as log:
        for message in messages:
            log(message)
    return path


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_gives_the_same_frames(suffix: str, tmp_path: Path) -> None:
    bus = read_bus(written(tmp_path / f"bus{suffix}", [*FRAMES, *OTHERS]))
    assert [frame for _, frame, _ in bus.frames] == [
        Frame(message.arbitration_id, bytes(message.data)) for message in FRAMES
    ]
    resolution_us = 1 if suffix in (".log", ".blf") else 100
    since_us = [round(1e6 * (message.timestamp - FRAMES[0].timestamp)) for message in FRAMES]
    for (us, _, _), expected_us in zip(bus.frames, since_us, strict=True):
        assert us - bus.frames[0].us == pytest.approx(expected_us, abs=resolution_us)
    assert sum(bus.left_out.values()) <= len(OTHERS)
    assert bus.left_out["frames with 29-bit identifiers"] == 1
    assert not bus.cut
    assert not bus.on_board_clock


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc"])
def test_the_direction_where_the_format_has_it(suffix: str, tmp_path: Path) -> None:
    bus = read_bus(written(tmp_path / f"bus{suffix}", FRAMES))
    assert [sent for _, _, sent in bus.frames] == [not message.is_rx for message in FRAMES]


def test_our_own_log_is_on_the_boards_clock(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text(GOOD)
    assert read_bus(log).on_board_clock
    log.write_text(GOOD.replace("steptwin0", "can0"))
    assert not read_bus(log).on_board_clock


def test_a_line_without_its_end_is_left_out(tmp_path: Path) -> None:
    """Its bytes may look like a whole frame."""
    log = tmp_path / "bus.log"
    log.write_text(GOOD + log_line(144_000, Frame(0x181, b"\x02\x03"))[:-3])
    bus = read_bus(log)
    assert len(bus.frames) == 1
    assert bus.cut


def test_a_binary_log_that_was_cut_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    log = written(tmp_path / "bus.blf", FRAMES * 2000)
    data = log.read_bytes()
    log.write_bytes(data[: len(data) * 2 // 3])
    bus = read_bus(log)
    assert bus.cut
    assert 0 < len(bus.frames) < len(FRAMES) * 2000


def test_a_clock_that_goes_back_does_not(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text("(2.5) can0 080#\n(2.4) can0 080#\n(2.6) can0 080#\n")
    assert [us for us, _, _ in read_bus(log).frames] == [2_500_000, 2_500_000, 2_600_000]


def test_a_channel_of_several(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text("(0.1) can0 080#\n(0.2) can1 181#01\n(0.3) can0 080#\n")
    assert len(read_bus(log, "can0").frames) == 2
    assert read_bus(log, "can1").left_out == {"of channel can0": 2}
    with refusing(InputError):
        read_bus(log)
    with refusing(InputError):
        read_bus(log, "can2")


def hostile() -> Iterator[tuple[str, bytes, str]]:
    yield "empty.log", b"", "holds no data frame"
    yield "empty.asc", b"", "holds no data frame"
    yield "empty.trc", b"", "holds no data frame"
    yield "empty.blf", b"", "after 0 frames: is not in the format of Vector's BLF"
    yield "words.log", b"to be or not to be\n", "line 1: is not in the format of a log of candump -L"
    yield "second.log", GOOD.encode() + b"\0\1\2\n", "line 2: is not in the format"
    yield "bytes.blf", bytes(range(256)) * 4, "after 0 frames: is not in the format"
    yield "log.blf", GOOD.encode() * 9, "after 0 frames: is not in the format"
    yield "zeros.log", bytes(100_000), "line 1: has more than 8192 characters"
    yield "long.log", b"(0.1) can0 181#" + b"01" * 9 + b"\n", "line 1: is not in the format"
    yield "nan.log", b"(nan) can0 181#01\n", "line 1: is not in the format"
    yield "inf.log", b"(inf) can0 181#01\n", "line 1: is not in the format"
    yield "above.log", b"(0.1) can0 FFF#01\n", "line 1: is not in the format"
    yield "extended.log", b"(0.1) can0 18FEF100#01\n", "identifier, but 1 frames with 29-bit identifiers"
    yield "fd.log", b"(0.1) can0 181##1" + b"01" * 12 + b"\n", "identifier, but 1 CAN FD frames"
    yield "days.log", b"(0.1) can0 181#01\n(90000.0) can0 181#01\n", "lasts 90000 s by its time stamps: at most 86400"
    yield "bus.mf4", b"MDF", "has no known format: a recorded bus is .log"
    yield "bus", b"", "has no known format: a recorded bus is .log"
    yield "bus.log.gz", gzip.compress(GOOD.encode()), "has no known format"
    yield "version.trc", b";$FILEVERSION=2.1\n;$COLUMNS=N,O\n 1 2 3\n", "is not in the format of PEAK's TRC"
    yield "start.trc", b";$FILEVERSION=2.1\n;$STARTTIME=nonsense\n", "is not in the format of PEAK's TRC"
    yield "date.asc", b"date Mon nonsense\nbase hex timestamps absolute\n", "holds no data frame"


@pytest.mark.parametrize(("name", "data", "complaint"), list(hostile()), ids=lambda value: str(value)[:12])
def test_what_is_no_recording_is_refused(name: str, data: bytes, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError) as refused:
        read_bus(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert complaint in str(refused.value)


def test_a_mistake_of_the_reader_is_not_blamed_on_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As with python-can 4.5, whose readers of text logs raise TypeErrors for every file."""

    def mistaken(_file: object) -> None:
        raise TypeError("unexpected keyword argument")

    monkeypatch.setattr(can, "CanutilsLogReader", mistaken)
    log = tmp_path / "bus.log"
    log.write_text(GOOD)
    with pytest.raises(TypeError):
        read_bus(log)


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    with refusing(InputError):
        read_bus(tmp_path / "no.log")
    (tmp_path / "folder.log").mkdir()
    with refusing(InputError):
        read_bus(tmp_path / "folder.log")


def test_a_recording_that_is_too_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "bus.log"
    log.write_text(GOOD * 3)
    monkeypatch.setattr(reading, "RECORDED_FRAMES_MAX", 3)
    assert len(read_bus(log).frames) == 3
    monkeypatch.setattr(reading, "RECORDED_FRAMES_MAX", 2)
    with refusing(InputError):
        read_bus(log)
    monkeypatch.setattr(reading, "RECORDED_BYTES_MAX", len(GOOD))
    with refusing(InputError):
        read_bus(log)


def test_a_clock_that_was_put_back(tmp_path: Path) -> None:
    """What follows is moved on, each time: it is not squeezed into the instant before."""
    log = tmp_path / "bus.log"
    log.write_text("(7200.5) can0 080#\n(3600.5) can0 080#\n(3600.6) can0 080#\n(0.1) can0 080#\n(0.2) can0 080#\n")
    read = read_bus(log)
    assert [us - 7_200_500_000 for us, _, _ in read.frames] == [0, 10_000, 110_000, 120_000, 220_000]
    assert read.steps_back == 2
