"""A served board as a library: in a thread of its own, for programs in the same process."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client.control_client import ControlClient
from steptwin.host.common.errors import InputError, RecordingError
from steptwin.host.record.folder import read_recording
from steptwin.host.robots import load_robot
from steptwin.host.robots.board_settings import Input
from steptwin.host.twin.live.served_board import ServedBoard
from tests.messages import refusing

pytestmark = pytest.mark.live

ROBOT = load_robot("lab-scara")
TIMEOUT_S = 60.0
NMT_START_ALL = can.Message(arbitration_id=0x000, data=[1, 0], is_extended_id=False)


def answer(bus: can.BusABC, cob_id: int) -> can.Message:
    """Return the next frame with this identifier."""
    while (message := bus.recv(TIMEOUT_S)) is not None:
        if message.arbitration_id == cob_id:
            return message
    raise AssertionError(f"no frame 0x{cob_id:03X} within {TIMEOUT_S:g} s")


def test_it_runs_while_the_block_lasts(fast_kernel: Kernel, tmp_path: Path) -> None:
    with ServedBoard(ROBOT, port=0, stand_at={"th2": 10.0}, kernel=fast_kernel, out=tmp_path / "out") as served:
        assert f"127.0.0.1:{served.port}" in served.title
        with can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=served.port) as bus:
            bus.send(NMT_START_ALL)
            answer(bus, 0x190)
        assert served.report()["axes"][1]["name"] == "th2"
    report = served.report()
    assert report["clients"]["served"] == 1
    assert report["joints"]["start"][1] == pytest.approx(10.0, abs=0.03)
    assert report["bus"]["frames"] > 4
    stored = json.loads((tmp_path / "out" / "report.json").read_text())
    assert set(stored.pop("files")) == {"bus.log", "edges.npz", "robot.toml"}
    assert stored == report | {"folder_version": 1}


def test_inputs_are_set_from_any_thread(fast_kernel: Kernel) -> None:
    """The board reports them by itself, with TPDO4; the joint is on the second of two boards."""
    robot = replace(ROBOT, inputs={"part": Input("th4", 2)})
    with (
        ServedBoard(robot, port=0, kernel=fast_kernel, axes_per_board=[2, 2]) as served,
        can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=served.port) as bus,
    ):
        bus.send(NMT_START_ALL)
        answer(bus, 0x190 + 3)
        served.set_input("part", on=True)
        while answer(bus, 0x490 + 3).data[:4] != b"\x00\x00\x08\x00":
            pass
        served.set_input("part", on=False)
        while answer(bus, 0x490 + 3).data[:4] != bytes(4):
            pass
        with refusing(InputError):
            served.set_input("box", on=True)


def test_on_a_bus_of_python_can(fast_kernel: Kernel) -> None:
    with can.Bus("served", interface="virtual") as bus:
        with ServedBoard(ROBOT, interface="virtual", channel="served", control_port=0, kernel=fast_kernel) as served:
            assert served.port is None
            assert served.control
            with ControlClient("127.0.0.1", served.control.port) as client:
                assert client.state().robot == "lab-scara"
            bus.send(NMT_START_ALL)
            answer(bus, 0x190)
        assert served.report()["interface"]["name"] == "virtual served"


def test_an_exception_in_the_board_leaves_the_recording(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Up to the last half second, and the exception passes on."""

    def fail() -> None:
        raise ZeroDivisionError("of the board")

    served = ServedBoard(ROBOT, port=0, kernel=fast_kernel, out=tmp_path / "out")
    served.call_every(1.2, fail)
    with refusing(ZeroDivisionError):
        served.serve_forever()
    recording = read_recording(tmp_path / "out")
    assert recording
    assert recording.until_s > 0.4
    assert recording.evidence().axes[0].name == "d1"


def test_a_recording_is_replaced_only_if_asked(fast_kernel: Kernel, tmp_path: Path) -> None:
    out, log = tmp_path / "out", tmp_path / "run.log"
    for _ in range(2):
        with ServedBoard(ROBOT, port=0, kernel=fast_kernel, out=out, log=log, replace=True):
            pass
    log.write_text("frames")
    for folder, file in ((out, None), (None, log)):
        with refusing(InputError):
            ServedBoard(ROBOT, port=0, kernel=fast_kernel, out=folder, log=file)
    with refusing(InputError):
        ServedBoard(ROBOT, port=0, kernel=fast_kernel, replace=True)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_a_file_that_cannot_be_written_is_an_error_at_the_end(fast_kernel: Kernel) -> None:
    served = ServedBoard(ROBOT, port=0, kernel=fast_kernel, log="/dev/full")
    served.__enter__()
    with can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=served.port) as bus:
        bus.send(NMT_START_ALL)
        answer(bus, 0x190)
    with refusing(RecordingError):
        served.__exit__()
    assert served.report()["bus"]["frames"] > 4


def test_errors_in_the_block_end_the_board_and_pass_on(fast_kernel: Kernel) -> None:
    with refusing(KeyError), ServedBoard(ROBOT, port=0, kernel=fast_kernel) as served:
        raise KeyError("of the block")
    assert served.report()["clients"]["served"] == 0


@pytest.mark.parametrize(
    "arguments",
    [
        {"port": 80},
        {"host": "0.0.0.0"},
        {"speed": 0.0},
        {"bitrate": 1},
        {"channel": "can0"},
        {"interface": "virtual", "port": 5000},
        {"axes_per_board": [3, 2]},
        {"stand_at": [0.0]},
    ],
)
def test_errors_name_the_parameter(arguments: dict[str, Any]) -> None:
    with refusing(InputError):
        ServedBoard(ROBOT, **({"port": 0} | arguments))
