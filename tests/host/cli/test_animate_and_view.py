"""`steptwin animate` and `steptwin view`: what the first writes and says, and what both refuse."""

import json
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.record import folder as folders
from tests.end_to_end.command_line import refusal
from tests.host.record.machines import perfect_run


@pytest.fixture
def stored(monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of a folder from which a run made without a board is read."""
    monkeypatch.setattr(folders, "read_run", lambda *_, **__: perfect_run("teaching-scara", "carry"))
    return "out"


def test_a_page_is_written(stored: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "arm.html"
    assert (
        run(["animate", stored, "--out", str(out), "--fps", "2", "--magnify", "50", "--camera", "-60,30", "--json"])
        == 0
    )
    document = json.loads(capsys.readouterr().out)
    assert document == {"file": str(out), "frames": 21, "duration_s": 10.0, "speed": 0.1, "magnified": 50.0}
    assert out.stat().st_size > 100_000


@pytest.mark.parametrize(
    "words",
    [
        ["--out", "arm.png"],
        ["--out", "arm.html", "--camera", "0,91"],
        ["--out", "arm.html", "--pulses", "5"],
        ["--out", "arm.gif", "--pulses", "0"],
        ["--out", "arm.html", "--speed", "0"],
        ["--out", "arm.html", "--from", "2"],
        ["--out", "arm.html", "--magnify", "0"],
        ["--out", "arm.html", "--width", "1"],
    ],
)
def test_refusals_name_the_option(
    stored: str, words: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    refusal(capsys, "animate", stored, *words)
    assert not list(tmp_path.iterdir())


def test_view_refuses_a_folder_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("nicegui")
    refusal(capsys, "view", str(tmp_path / "none"), "--port", "0")
    refusal(capsys, "view", "out", "--port", "99999")
