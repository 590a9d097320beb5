"""`steptwin monitor` of a stored bus: a run's folder, its log, another program's log, and what does not go with one."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal, run_json

LOG = "(1.500000) can0 090#208105\n(1.600000) can0 710#05\n(3.000000) can0 080#\n"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "other.log"
    file.write_text(LOG, encoding="utf-8")
    return file


def test_a_runs_folder_names_its_joints(carry_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in (carry_run, carry_run / "bus.log"):
        capsys.readouterr()
        assert run(["monitor", str(name), "--node", "th2", "--count", "1"]) == 0
        assert capsys.readouterr().out == "0.000113 711 HEARTBEAT th2      boot-up\n"


def test_another_programs_log(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(["monitor", str(log), "--seconds", "1"]) == 0
    assert [line[:25] for line in capsys.readouterr().out.splitlines()] == [
        "1.500000 090 EMCY      0x",
        "1.600000 710 HEARTBEAT 0x",
    ]
    document = run_json(capsys, "monitor", "teaching-scara", "--log", str(log), "--service", "sync")
    assert [(each["time_s"], each["cob_id"]) for each in document["frames"]] == [(3.0, 0x80)]
    document = run_json(capsys, "monitor", "teaching-scara", "--log", str(log), "--node", "th1")
    assert len(document["frames"]) == 2


def test_no_live_board_goes_with_it(log: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    refusal(capsys, "monitor", str(log), "--connect", "127.0.0.1")
    refusal(capsys, "monitor", str(tmp_path / "none.log"))
    refusal(capsys, "monitor", str(tmp_path))
