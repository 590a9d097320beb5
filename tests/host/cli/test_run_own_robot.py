"""`run PROGRAM`, without a robot before it: the program names its own."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot

STEP = "[[step]]\ngo = { th1 = 1.0 }\nduration_s = 0.5\n"


@pytest.mark.slow
def test_a_program_that_names_its_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "arm.toml").write_text(load_robot("teaching-scara").toml)
    for number, robot in enumerate(("teaching-scara", "arm.toml")):
        path = tmp_path / f"pick{number}.toml"
        path.write_text(f'robot = "{robot}"\n{STEP}')
        assert run(["run", str(path), "--kernel", "python"]) == 0
        assert capsys.readouterr().out.endswith(": PASSED\n")


def test_one_that_names_none_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pick.toml"
    path.write_text(STEP)
    assert run(["run", str(path)]) == 2
    assert f"{path}: names no robot: write it as `robot` in the file, or before the file" in capsys.readouterr().err
