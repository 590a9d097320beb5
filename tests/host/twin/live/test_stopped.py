"""A live board whose machine was stopped: `verify` says by what and when, and does not pass it."""

import json
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.protocol import od
from steptwin.protocol.frame import COB_SDO_REQUEST, Frame
from steptwin.protocol.sdo_frames import download_request
from tests.host.twin.live.live_session import NODE, SYNC, THERE_AND_BACK, LiveSession, control, queue, start_at_sync

ESTOP = Frame(COB_SDO_REQUEST + NODE, download_request(od.EMERGENCY_STOP, b"\x01"))
QUICK_STOP = control(0x0B)


def begin(session: LiveSession, sequence: int) -> None:
    """Begin the motion and let it go on for 30 of its 100 ms."""
    session.send(*queue(*(record._replace(sequence=sequence + i) for i, record in enumerate(THERE_AND_BACK))))
    session.send(control(0x0F), start_at_sync(), SYNC)
    session.wait(30)


@pytest.fixture
def session(fast_kernel: Kernel, tmp_path: Path) -> LiveSession:
    """A board that has come to the end of a motion."""
    session = LiveSession(fast_kernel, tmp_path)
    session.send(Frame(0x000, b"\x01\x00"))
    session.move(0)
    return session


@pytest.mark.slow
def test_an_emergency_stop_in_a_wait(session: LiveSession, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session.send(ESTOP)
    at_s = session.now_ns / 1e9
    session.wait(200)
    session.end()
    stopped = json.loads((tmp_path / "report.json").read_text())["stopped"]
    assert stopped == {"at_s": pytest.approx(at_s, abs=0.002), "by": "emergency stop", "in_motion": False}
    assert run(["verify", str(tmp_path)]) == 1
    last = capsys.readouterr().out.splitlines()[-2:]
    assert last[0] == "warehouse-scara live: STOPPED"
    assert last[1] == f"  was stopped at rest by emergency stop, {stopped['at_s']:.3f} s after power-up"
    assert run(["verify", str(tmp_path), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["passed"], document["stopped"]) == (False, pytest.approx(stopped))


@pytest.mark.parametrize(("frame", "by"), [(ESTOP, "emergency stop"), (QUICK_STOP, "a stop of a host")])
def test_a_stop_on_the_way(
    frame: Frame, by: str, fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    session.send(Frame(0x000, b"\x01\x00"), *(control(word) for word in (0x06, 0x07, 0x0F)))
    begin(session, 0)
    session.send(frame)
    session.wait(200)
    session.end()
    assert run(["verify", str(tmp_path)]) == 1
    told = capsys.readouterr().err
    assert f"was stopped on its way by {by}, 0." in told
    assert "there is no plan to verify" in told


@pytest.mark.slow
def test_a_stop_of_a_later_motion(session: LiveSession, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder shows the motion before, whose program was stopped all the same."""
    begin(session, 2)
    session.send(ESTOP)
    session.wait(200)
    session.end()
    assert run(["verify", str(tmp_path)]) == 1
    assert "was stopped on its way by emergency stop" in capsys.readouterr().out


@pytest.mark.slow
def test_a_motion_after_the_stop_passes(session: LiveSession, tmp_path: Path) -> None:
    session.send(ESTOP)
    session.wait(50)
    session.send(control(0x80), control(0x00))
    session.move(2)
    session.end()
    assert json.loads((tmp_path / "report.json").read_text())["stopped"] is None
    assert run(["verify", str(tmp_path)]) == 0


def test_a_recording_without_its_end(session: LiveSession, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As when the board still runs."""
    session.send(ESTOP)
    session.wait(200)
    session.board.record()
    assert run(["verify", str(tmp_path)]) == 1
    assert "was stopped at rest by emergency stop" in capsys.readouterr().out
