"""`steptwin shadow` on a bus whose frames are those of a machine in virtual time; it has no way to send."""

import json
from pathlib import Path

import can
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.host.cli.app import run
from steptwin.host.client.links import bus_link
from steptwin.host.operate.homing import home_robot
from steptwin.host.robots import load_robot
from tests.features.shadow.machines import Heard, Real

ROBOT = load_robot("teaching-scara")
COMMAND = ["shadow", "teaching-scara", "--connect", "127.0.0.1"]


class HeardBus:
    """A bus of python-can that lets frames be heard, then Ctrl-C be pressed; sending fails the test."""

    def __init__(self, heard: Heard) -> None:
        self._heard = iter(heard)

    def __enter__(self) -> "HeardBus":
        return self

    def __exit__(self, *_: object) -> None: ...

    def recv(self, _timeout_s: float) -> can.Message:
        for us, frame in self._heard:
            return can.Message(timestamp=us / 1e6, arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        raise KeyboardInterrupt

    def __getattr__(self, name: str) -> object:
        raise AssertionError(f"the shadow uses its bus to {name}")


@pytest.fixture(scope="module")
def estopped(fast_kernel: Kernel) -> tuple[Heard, int]:
    """Return the frames of a machine of which one joint is homed, and after some frames stopped by its button."""
    real = Real(ROBOT, fast_kernel)
    home_robot(real.session, joints=["th2"])
    real.board.wait(0.5)
    before = len(real.board.bus_log)
    real.operate(EmergencyStop(pressed=True))
    real.board.wait(1.0)
    return real.heard(jitter_us=300), before


def shadowing(heard: Heard, monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(bus_link, "open_bus", lambda _: HeardBus(heard))
    return run([*COMMAND, *words])


@pytest.mark.slow
def test_nothing_differs(
    estopped: tuple[Heard, int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    heard, before = estopped
    assert shadowing(heard[:before], monkeypatch) == 0
    assert capsys.readouterr().out.endswith(" frames of the board: the board does what its twin does\n")


@pytest.mark.slow
def test_nothing_differs_as_json(
    estopped: tuple[Heard, int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    heard, before = estopped
    assert shadowing(heard[:before], monkeypatch, "--json") == 0
    told = capsys.readouterr()
    (line,) = told.out.splitlines()
    summary = json.loads(line)
    assert summary.pop("board_frames") > 200
    assert summary == {"joined": True, "discrepancies": 0}
    assert told.err == "joined: the twin goes along with the machine\n"  # once, at the boot-up


@pytest.mark.slow
def test_each_discrepancy_is_a_line(
    estopped: tuple[Heard, int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert shadowing(estopped[0], monkeypatch, "--json") == 1
    *lines, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert [(line["axis"], line["kind"]) for line in lines] == [
        (axis, kind) for kind in ("error", "state") for axis in ROBOT.axis_names
    ]
    assert last["discrepancies"] == len(lines) == 8


@pytest.mark.slow
def test_until_the_first_one(
    estopped: tuple[Heard, int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert shadowing(estopped[0], monkeypatch, "--until-difference") == 1
    lines = capsys.readouterr().out.splitlines()
    assert "th1 error: board EMCY th1 estop (0x9000)" in lines[0]
    assert len(lines) <= 9  # all that is due by then, and the sum
    assert lines[-1].endswith(" discrepancies")


@pytest.mark.slow
def test_the_folder(
    estopped: tuple[Heard, int], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The twin's run is a folder as any other; beside it are the real board's frames and what was told."""
    heard, before = estopped
    out = tmp_path / "night"
    assert shadowing(heard, monkeypatch, "--out", str(out)) == 1
    told = (out / "discrepancies.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(told) == 8
    assert len((out / "board.log").read_text(encoding="ascii").splitlines()) == len(heard)
    capsys.readouterr()
    assert run(["replay", str(out)]) == 0
    assert run(["replay", str(out / "board.log"), "teaching-scara"]) == 1  # it stopped without a cause in the frames
    assert "FAULT" in capsys.readouterr().out
    assert shadowing(heard[before:], monkeypatch, "--join", str(out), "--out", str(tmp_path / "more")) == 1


def test_without_a_boot_up_it_says_what_to_do(
    estopped: tuple[Heard, int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert shadowing(estopped[0][100:], monkeypatch) == 1
    assert "switch the board on or reset its nodes" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--seconds", "0"], "--seconds 0: is not above 0 and finite"),
        (["--join", "nowhere"], "nowhere"),
        (["--machine", "stand-at=1 2"], "--machine stand-at"),
    ],
)
def test_bad_input(
    words: list[str], complaint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert shadowing([], monkeypatch, *words) == 2
    assert complaint in capsys.readouterr().err
