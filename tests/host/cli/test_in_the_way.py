"""What is in the way of the files of --out is told before the work, not after it."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from steptwin.features.campaigns.results import Results
from tests.end_to_end.command_line import refusal
from tests.features.campaigns.campaigns import SMALL
from tests.run_pictures import with_pictures

PLOT = pytest.mark.skipif(not find_spec("matplotlib"), reason="the extra `plot` is not installed")


def _nothing(*_: Any, **__: Any) -> None:
    pytest.fail("the work has begun")


EXECUTE = "steptwin.host.twin.embedded.execution.execute"


@pytest.mark.parametrize(
    ("words", "work", "name"),
    [
        ("run teaching-scara carry", EXECUTE, "report.json"),
        ("run teaching-scara carry", EXECUTE, "trace.vcd"),
        pytest.param("run teaching-scara carry", EXECUTE, "timing.png", marks=PLOT),
        ("workspace teaching-scara", "steptwin.host.robots.workspace.scan", "cloud.csv"),
    ],
)
def test_a_folder_with_the_name_of_a_file_is_told(
    words: str,
    work: str,
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(work, _nothing)
    (tmp_path / name).mkdir()
    told = f"--out {tmp_path}: {name} in it is a folder, where a file is to be written"
    with with_pictures():
        assert refusal(capsys, *words.split(), "--out", str(tmp_path)) == told


def test_a_run_of_a_campaign_is_made_again_into_a_folder_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("steptwin.features.campaigns.running.perform", _nothing)
    folder = tmp_path / "evening"
    with Results(folder).writing():
        (folder / "campaign.toml").write_text(SMALL, encoding="utf-8")
    again = ("campaign", "rerun", str(folder), "0", "--out")
    own = "is the campaign's own folder: take another one"
    assert refusal(capsys, *again, f"{folder}/../evening") == f"--out {folder}/../evening: {own}"
    (tmp_path / "run" / "edges.npz").mkdir(parents=True)
    in_the_way = refusal(capsys, *again, str(tmp_path / "run"))
    assert in_the_way.startswith(f"--out {tmp_path}/run: ")
