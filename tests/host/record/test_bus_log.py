"""A bus log grows while it is written, and its end is told when it cannot."""

from pathlib import Path

import pytest

from steptwin.host.record.bus_log import BusLog, count_frames, log_line, read_frames
from steptwin.protocol.frame import Frame

FRAMES = [(72 * us, Frame(0x080 + us, bytes([us]))) for us in range(5)]
LINES = [log_line(*frame) for frame in FRAMES]


def test_what_is_appended_is_in_the_file_at_once(tmp_path: Path) -> None:
    log = BusLog(tmp_path / "run.log")
    for number, line in enumerate(LINES):
        assert count_frames(tmp_path / "run.log") == number
        log.append([line], float(number))
    assert list(read_frames(tmp_path / "run.log")) == FRAMES
    assert list(read_frames(tmp_path / "run.log", 2)) == FRAMES[:2]
    log.close()
    assert log.failure is None


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_a_full_disk_ends_it() -> None:
    log = BusLog(Path("/dev/full"))
    log.append([], 1.5)
    log.append(LINES, 2.0)
    log.append(LINES, 2.5)
    assert str(log.failure) == "/dev/full: No space left on device: the bus log ends at 1.500 s"
    log.close()
