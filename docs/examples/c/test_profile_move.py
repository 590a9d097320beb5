"""Test a CANopen master in C against StepTwin: compile it, let it move an axis of a served board, count the steps."""

import subprocess
from pathlib import Path

import pytest

from steptwin import ServedBoardUnderTest

HERE = Path(__file__).parent
UNITS_PER_STEP = 1024
"""Wire units of a step at 1/16."""


@pytest.fixture(scope="session")
def master(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("master") / "profile_move"
    sources = [HERE / "profile_move.c", HERE / "socketcand.c"]
    subprocess.run(["cc", "-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-o", program, *sources], check=True)
    return program


@pytest.mark.steptwin("teaching-scara")
def test_the_master_moves_an_axis(master: Path, steptwin_served_board: ServedBoardUnderTest) -> None:
    board = steptwin_served_board
    words = [str(master), str(board.port), "0x11", str(-200 * UNITS_PER_STEP)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("node 0x11: statusword 0x")
    th2 = board.evidence().axes[1]
    assert th2.step_signs.sum() == -200
    assert th2.violations.counts.size == 0
    assert board.joints()["th2"] == pytest.approx(-360 * 200 / (200 * 16 * 4), abs=0.01)


@pytest.mark.steptwin("teaching-scara")
def test_a_node_that_does_not_answer(master: Path, steptwin_served_board: ServedBoardUnderTest) -> None:
    words = [str(master), str(steptwin_served_board.port), "0x40", "0"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (1, "profile_move: no answer to an SDO request\n")
