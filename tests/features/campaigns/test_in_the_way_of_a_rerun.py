"""What stands where a run of a campaign is to be made again is told before anything is run."""

from pathlib import Path
from typing import NoReturn

import pytest

from steptwin.features.campaigns.results import Results
from tests.end_to_end.command_line import refusal
from tests.features.campaigns.campaigns import SMALL


def _nothing(*_: object, **__: object) -> NoReturn:
    raise AssertionError("something was run")


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
