"""The README and the page of a first run do what they say."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.marks import slow_but
from tests.end_to_end.pages import ROOT, blocks_of, read_page, run_python

README = read_page("README.md")
PAGE = read_page("docs/first-run.md")
MOTIONS = read_page("docs/motions.md")
BLOCKS = blocks_of(PAGE)
COMMANDS = [
    line for language, block in BLOCKS if not language for line in block.splitlines() if line.startswith("steptwin ")
]
DEAR = ("run ", "paper ", "bench ", "plot ", "workspace ")
CHEAP = [
    line
    for line in COMMANDS
    if not line.removeprefix("steptwin ").startswith(DEAR) or " calibration-scara demo" in line
]


@pytest.mark.parametrize("line", slow_but(CHEAP, COMMANDS))
def test_command(line: str, carry_run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each exits with 0, but the run whose stream is cut with 3, and the run with slow drivers with 1."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line.split(">", maxsplit=1)[0], comments=True)
    if words[1] in {"trace", "plot", "verify", "replay"}:
        shutil.copytree(carry_run, words[2])
    expected = {"--cut-stream": 3, "driver-profile=3a-module": 1}
    assert run(words[1:]) == next((code for option, code in expected.items() if option in words), 0)


def test_there_are_commands() -> None:
    assert len(COMMANDS) >= 8


PROGRAMS = dict.fromkeys(
    block for text in (README, PAGE, MOTIONS) for language, block in blocks_of(text) if language == "python"
)


@pytest.mark.parametrize(
    "code",
    [pytest.param(code, marks=pytest.mark.slow) if "drawer-pull" in code else code for code in PROGRAMS],
    ids=lambda code: code.splitlines()[-2],
)
def test_python(code: str, tmp_path: Path) -> None:
    run_python(code, tmp_path)


@pytest.mark.slow
def test_it_shows_what_the_demo_prints(capsys: pytest.CaptureFixture[str]) -> None:
    """The README shows all lines but those with wall times."""
    assert run(["run", "warehouse-scara", "drawer-pull"]) == 0
    printed = [line for line in capsys.readouterr().out.splitlines() if "SIMULATED" not in line]
    assert len(printed) >= 10
    for line in printed:
        assert line.rstrip() in README


def test_it_is_short_and_begins_with_a_moving_picture() -> None:
    """A visitor sees in thirty seconds what it is: at most 110 lines, and a picture of less than 500 kB."""
    lines = README.splitlines()
    assert len(lines) <= 110
    (picture,) = re.findall(r"\]\((docs/pictures/[^)]*\.gif)\)", lines[4])
    assert (ROOT / picture).stat().st_size < 500_000


@pytest.mark.slow
def test_when_a_run_fails_has_each_reason_of_the_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    """A run that fails in most ways at once, and the reasons that it has not, as the verifier words them."""
    _, section = PAGE.split("\n## When a run fails\n")
    assert run(["run", "lab-scara", "spiral", "--machine", "driver-profile=3a-module"]) == 1
    _, told = capsys.readouterr().out.split("lab-scara spiral: FAILED\n")
    for line in told.splitlines():
        words = re.sub(r" [-\d].*", "", line.split(": ", 1)[1])
        assert f"`{words}" in section, line
    source = "".join((ROOT / "host" / name).read_text(encoding="utf-8") for name in VERDICTS)
    for words in (
        "the motor lost", "full steps from", "steps came while the driver's outputs were off", "switched",
        "changes that were not planned", "STOPPED BY A FAULT", "STOPPED BY A WAIT THAT TIMED OUT", "INCOMPLETE",
    ):  # fmt: skip
        assert words in source
        assert words in section


VERDICTS = ("verify/verifier.py", "verify/switching.py", "cli/run/verdict_text.py", "record/verdict_words.py")
