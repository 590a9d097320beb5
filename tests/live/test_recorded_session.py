"""A session on a served board that python-can's logger has recorded, replayed: the same answers, the same steps."""

import json
import signal
import sysconfig
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.end_to_end.command_line import run_json
from tests.end_to_end.served import in_real_time, serving
from tests.end_to_end.terminal import Terminal

ROBOT = "teaching-scara"


@in_real_time
def test_what_can_logger_has_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It sees frames when they have come through two sockets, by the stamps of the board's clock since 1970."""
    folder = Path(mkdtemp(dir=tmp_path))
    program = str(Path(sysconfig.get_path("scripts")) / "can_logger")
    with serving(ROBOT, "--out", str(folder / "served")) as server:
        options = ["-i", "socketcand", "-c", "vcan0", "--bus-kwargs", "host=127.0.0.1", f"port={server.port}"]
        with Terminal([program, *options, "-f", "can.log"], folder) as recording:
            recording.await_text("Connected to SocketCanDaemonBus")
            assert server.run("home", ROBOT, "--here", "0 0 0 0") == 0
            assert server.run("run", ROBOT, "carry") == 0
            assert server.run("move", ROBOT, "th2=10") == 0
            recording.interrupt()
        assert server.end(signal.SIGTERM)[0] == 0
    log = str(folder / "can.log")
    document = run_json(capsys, "replay", log, ROBOT, "--against", str(folder / "served"))
    assert document["clock"] == "wall"
    assert document["equal"], json.dumps(document, indent=1)
    assert document["played_frames"] > 500
