"""Fixtures of the tests that operate a live board."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from tests.host.operate.sessions import HOME, CommandLine, board_at, preset


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return board_at(HOME, fast_kernel)


@pytest.fixture
def session(board: EmbeddedBoard) -> Session:
    """A session on a machine whose position is known."""
    return preset(board, HOME)


@pytest.fixture
def steptwin(board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(board, monkeypatch, capsys)
