"""`steptwin view`: what it refuses."""

from pathlib import Path

import pytest

from tests.end_to_end.command_line import refusal


def test_view_refuses_a_folder_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("nicegui")
    refusal(capsys, "view", str(tmp_path / "none"), "--port", "0")
    refusal(capsys, "view", "out", "--port", "99999")
