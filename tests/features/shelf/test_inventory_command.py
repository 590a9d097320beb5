"""`run --inventory`: a slot is allotted, a box is found, and the file is written only after a verified run."""

import json
from pathlib import Path

import pytest

from steptwin.features.shelf.inventory import read_inventory
from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot

ROBOT = "warehouse-scara"
QUICK = ["-o", "pull_s=2"]


def held(path: Path) -> dict[str, str]:
    return dict(read_inventory(str(path), load_robot(ROBOT)).boxes)


@pytest.mark.slow
def test_the_file_is_written_after_a_verified_run_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "stock.toml"
    with_file = ["--inventory", str(path), *QUICK]
    assert run(["run", ROBOT, "store", "screws", *with_file, "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["shelf"]["end"] == {"A1": "screws", "pick-up": "pick-up-1"}
    assert printed.err.splitlines()[-1] == f"{path}: A1 screws"
    assert held(path) == {"A1": "screws"}
    written = path.read_bytes()
    for words, code, said in (
        (["store", "screws"], 2, "box 'screws': is in slot A1 already"),
        (["fetch", "screws", "--machine", "locked-drawer=A1"], 1, "A1: pull on a locked drawer"),
        (["fetch", "screws", "--connect", "127.0.0.1"], 2, "--inventory: is for a run in virtual time"),
        (["pull-line"], 2, "job pull-line: carries no boxes"),
    ):
        assert run(["run", ROBOT, *words, "--inventory", str(path), *(QUICK if len(words) > 1 else [])]) == code
        printed = capsys.readouterr()
        assert said in printed.out + printed.err
        assert path.read_bytes() == written


def test_a_box_needs_an_inventory(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", ROBOT, "fetch", "screws"]) == 2
    assert "box 'screws': boxes have names in an inventory: --inventory FILE" in capsys.readouterr().err
