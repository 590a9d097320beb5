"""CAN frames of an image: the example takes its moves from a script or a test, and a wrong bit rate is told."""

import json
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import python_kernel
from steptwin.features.stm32.can_script import CanPort, FrameExpectationError
from steptwin.features.stm32.options import Stm32Options
from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.features.stm32.examples import EXAMPLES, ROBOT

_IMAGE = EXAMPLES / "can_stepper.elf"
_SCRIPT = EXAMPLES / "moves.log"
_TARGET_4 = bytes.fromhex("04000000314E")


@pytest.mark.slow  # a sixth of a second at 72 MHz in plain Python
@pytest.mark.parametrize(
    ("name", "code", "reason"), [("can_stepper", 0, ""), ("can_stepper_fault", 1, "CLK high too short: step missed")]
)
def test_the_example_takes_its_moves_from_a_script(
    capsys: pytest.CaptureFixture[str], name: str, code: int, reason: str
) -> None:
    words = ["--robot", str(ROBOT), "--can", str(_SCRIPT), "--for", "150ms", "--kernel", "python", "--json"]
    assert run(["run-image", str(EXAMPLES / f"{name}.elf"), *words]) == code
    document = json.loads(capsys.readouterr().out)
    assert document["not_modelled"] == []
    assert len(document["reasons"]) == code
    assert all(reason in each for each in document["reasons"])
    if not code:
        assert [axis["steps"] for axis in document["axes"]] == [300, -200]
        assert {(each["id"], each["data"]) for each in document["can"] if each["id"] < "200"} == {
            ("180", "2C010000"),
            ("181", "38FFFFFF"),
        }


@pytest.mark.slow  # 20 ms at 72 MHz in plain Python
def test_a_test_sends_frames_and_expects_others() -> None:
    robot = load_robot(str(ROBOT))
    options = Stm32Options(image=_IMAGE).fitted(robot, Path(), compiled=False)
    board = BoardUnderTest(robot, kernel=python_kernel(), extras=(options,))
    can = CanPort(board)
    board.wait(0.002)
    can.send(0x200, _TARGET_4)
    with pytest.raises(FrameExpectationError, match=r"^no frame 180 within 0.001 s, but 200#04000000314E$"):
        can.expect(0x180, within_s=0.001)
    assert can.expect(0x180, within_s=0.02) == bytes((4, 0, 0, 0))
    assert board.steps()["left"] == 4


def test_a_wrong_bit_rate_fails_the_run_with_a_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    robot = tmp_path / "arm.toml"
    robot.write_text(ROBOT.read_text().replace("[board]\n", "[board]\nbitrate = 500_000\n"))
    words = ["--robot", str(robot), "--can", str(_SCRIPT), "--for", "4ms", "--kernel", "python", "--json"]
    assert run(["run-image", str(_IMAGE), *words]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["can"] == []
    assert document["reasons"] == [
        "CAN: BTR = 0x001E0001 makes 1000000 bit/s of PCLK1 = 36 MHz; the bus has 500000 bit/s, so no frame can be sent"
        " or received"
    ]
