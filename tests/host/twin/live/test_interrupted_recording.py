"""A live board's recording without its end: what verify, plot and trace make of it, at every instant."""

from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_recording, read_run, verify_folder
from steptwin.protocol.pvt import PvtRecord
from tests.host.twin.live.live_session import (
    JOINT,
    NMT_START,
    SYNC,
    UNITS_PER_STEP,
    LiveSession,
    enable,
    queue,
    start_at_sync,
)

RECORDS = (
    *(PvtRecord(20 * UNITS_PER_STEP, 64 * 1024, 40, sequence) for sequence in range(2, 6)),
    PvtRecord(20 * UNITS_PER_STEP, 0, 40, 6),
)
"""100 steps in 200 ms."""
START = [*enable(), *queue(*RECORDS), start_at_sync(), SYNC]


def begin_motion(kernel: Kernel, folder: Path, drivers: str | None = None) -> LiveSession:
    """Move there and back, and begin the motion of the records with a SYNC."""
    session = LiveSession(kernel, folder, drivers=drivers)
    session.send(NMT_START)
    session.move(0)
    session.send(*START)
    return session


def verdict_after(kernel: Kernel, folder: Path, dt_ms: int) -> tuple[tuple[str, ...], float, int]:
    """Return the reasons of a recording that ends some time after a SYNC, its duration, and the pulses judged."""
    begin_motion(kernel, folder).wait(dt_ms)
    pulses = verify_folder(folder).report.axes[JOINT].pulses
    return verify_folder(folder).reasons, read_run(folder).duration_s, pulses - 40


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dt_ms", "motion", "duration_s", "pulses"),
    [
        (130, "0.080 s into the last motion", 0.08, 40),
        (180, "0.120 s into the last motion", 0.12, 60),
        (300, "its last motion had ended", 0.2, 100),
    ],
)
def test_it_is_judged_as_far_as_it_goes(
    dt_ms: int, motion: str, duration_s: float, pulses: int, fast_kernel: Kernel, tmp_path: Path
) -> None:
    reasons, judged_s, made = verdict_after(fast_kernel, tmp_path, dt_ms)
    recording = read_recording(tmp_path)
    assert recording
    end = f"the recording has no end: it goes to {recording.until_s:.3f} s after power-up"
    assert reasons == (f"{end}, {motion}; so far it is right",)
    assert judged_s == pytest.approx(duration_s)
    assert made == pytest.approx(pulses, abs=1)


def test_a_wrong_pulse_in_it_is_found(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Drivers that count no pulse do not make the motion, whole or not."""
    begin_motion(fast_kernel, tmp_path, "slow-blue-board").wait(130)
    first, *others = verify_folder(tmp_path).reasons
    assert first.endswith("0.080 s into the last motion")
    assert any(reason.startswith("th1: unmatched steps") for reason in others)
    assert run(["verify", str(tmp_path)]) == 1


@pytest.mark.slow
def test_a_changed_bus_log_is_found(fast_kernel: Kernel, tmp_path: Path) -> None:
    verdict_after(fast_kernel, tmp_path, 130)
    log = tmp_path / "bus.log"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join((*lines, "(00000000")))  # what follows the last mark does not matter
    assert len(verify_folder(tmp_path).reasons) == 1
    assert run(["trace", str(tmp_path), "--format", "vcd-full"]) == 0
    log.write_text("".join(lines[:-1]))
    assert f"bus.log has {len(lines) - 1}" in verify_folder(tmp_path).reasons[1]


def test_a_motion_that_has_just_begun_cannot_be_judged(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = begin_motion(fast_kernel, tmp_path)
    session.board.record()
    session.wait(10)
    session.board.record()
    assert run(["verify", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert f"{tmp_path}: the recording ends 0.0" in message
    assert "there is no second point up to 0.0" in message


def test_without_a_motion_there_is_nothing_to_judge(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    LiveSession(fast_kernel, tmp_path).wait(100)
    assert run(["verify", str(tmp_path)]) == 2
    assert "trajectory.csv: is missing: no trajectory was run" in capsys.readouterr().err
    assert run(["trace", str(tmp_path)]) == 2
    assert "no pin has changed since power-up" in capsys.readouterr().err


@pytest.mark.slow
def test_pictures_are_of_what_is_there(fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    verdict_after(fast_kernel, tmp_path, 130)
    assert run(["plot", str(tmp_path), "--what", "joints"]) == 0
    said = capsys.readouterr()
    assert said.out == f"{tmp_path / 'joints.png'}\n"
    assert said.err.startswith(f"steptwin: warning: {tmp_path}: the recording has no end: it goes to ")
