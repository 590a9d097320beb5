"""The example of a feature in a package of its own works once it is installed, without a change of StepTwin."""

import json
import os
import subprocess
import sys
from itertools import dropwhile
from pathlib import Path

import pytest

from tests.package.wheels import ROOT, build, install

EXAMPLE = ROOT / "examples" / "wear"
STILL = "t,d1,th2,th3,th4\n0,150,0,30,0\n1,155,0,30,0\n"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which the example is installed."""
    return install(build("wheel", EXAMPLE, tmp_path_factory.mktemp("dist")), tmp_path_factory.mktemp("site"))


def steptwin(installed: Path, folder: Path, *words: str) -> tuple[int, str]:
    """Run the command line beside the installed example; return its exit code, and what it has printed."""
    path = os.pathsep.join([str(installed), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", "steptwin", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def write_robot(folder: Path, life_turns: float) -> None:
    from steptwin.host.robots import brought_text

    text = brought_text("lab-scara").replace('name = "lab-scara"', 'name = "arm"')
    (folder / "arm.toml").write_text(f"{text}\n[wear]\nlife_turns = {life_turns}\n", encoding="utf-8")
    (folder / "still.csv").write_text(STILL, encoding="utf-8")


@pytest.mark.slow
def test_it_has_a_section_a_participant_a_command_and_a_column(installed: Path, tmp_path: Path) -> None:
    """Five millimetres of the lift are a quarter of a turn: its belt has 20 mm a turn."""
    write_robot(tmp_path, 5e6)
    code, said = steptwin(installed, tmp_path, "run", "arm.toml", "still.csv", "--out", "out")
    assert code == 0, said
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert report["wear"]["axes"]["d1"] == pytest.approx({"turns": 0.25, "life_percent": 5e-6}, rel=0.01)
    words = [line.split() for line in said.splitlines()]
    heading, _, lift, *_ = dropwhile(lambda each: each[:1] != ["axis"], words)
    assert (heading[-2:], lift[-2:]) == (["broken", "turns"], ["0", "0.250"])
    assert steptwin(installed, tmp_path, "verify", "out")[0] == 0
    code, said = steptwin(installed, tmp_path, "wear", "out")
    assert (code, said.splitlines()[2].split()[:2]) == (0, ["d1", "0.250"])
    assert "Tell how worn a run leaves the axes." in steptwin(installed, tmp_path, "--help")[1]


@pytest.mark.slow
def test_it_fails_a_run_and_refuses_a_wrong_section(installed: Path, tmp_path: Path) -> None:
    write_robot(tmp_path, 0.1)
    code, said = steptwin(installed, tmp_path, "run", "arm.toml", "still.csv")
    assert code == 1
    assert "wear: d1 has turned more often than it lasts" in said
    write_robot(tmp_path, 0.0)
    assert "wear.life_turns: 0 is not above 0" in steptwin(installed, tmp_path, "check", "arm.toml")[1]


@pytest.mark.slow
def test_without_it_the_section_is_refused(tmp_path: Path) -> None:
    write_robot(tmp_path, 5e6)
    assert steptwin(tmp_path, tmp_path, "check", "arm.toml") == (
        2,
        "arm.toml: wear: no feature that is installed has a table of this name\n",
    )


def test_it_is_short() -> None:
    sources = (EXAMPLE / "steptwin_wear").glob("*.py")
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in sources) <= 120
