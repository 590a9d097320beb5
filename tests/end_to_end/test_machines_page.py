"""docs/machines.md: each session shows what its command prints."""

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT, blocks_of, read_page

pytestmark = pytest.mark.slow

PAGE, _, _ = read_page("docs/machines.md").partition("## Calibration")
SESSIONS = [text for language, text in blocks_of(PAGE) if language == "console"]


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session.splitlines()[0][2:60])
def test_a_session_is_what_its_command_prints(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    session: str,
    example_run: Callable[[str], Path],
) -> None:
    """All but the time that it took; the tool's figures to a thousandth, since floats differ by processor."""
    monkeypatch.chdir(ROOT)
    command, *shown = session.splitlines()
    words = shlex.split(command.removeprefix("$ steptwin "))
    if words == ["run", words[1], f"docs/programs/{words[1]}.toml"]:
        *lines, _folder = (example_run(words[1]) / "printed.txt").read_text(encoding="utf-8").splitlines()
    else:
        assert run(words) == (": FAILED" in session)
        lines = capsys.readouterr().out.splitlines()
    lines = [line.replace(f"{ROOT}/", "") for line in lines]  # an example is run by its full path
    printed = [line.rstrip() for line in lines if not line.startswith("SIMULATED ")]
    assert [_NUMBER.sub("", line) for line in printed] == [_NUMBER.sub("", line) for line in shown]
    for line, expected in zip(printed, shown, strict=True):
        if line.startswith("tool: "):
            assert _numbers(line) == pytest.approx(_numbers(expected), rel=1e-3)
        else:
            assert line == expected


_NUMBER = re.compile(r"\d+\.\d+")


def _numbers(line: str) -> list[float]:
    return [float(number) for number in _NUMBER.findall(line)]


def test_from_nothing_to_a_verified_pick_and_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first blocks of the page, in an empty folder."""
    program, commands = re.findall(r"<!-- pick -->\n```\w*\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    monkeypatch.chdir(tmp_path)
    Path("pick.toml").write_text(program, encoding="utf-8")
    lines = [shlex.split(line, comments=True) for line in commands.splitlines()]
    assert len(lines) == 7
    for name, *words in lines:
        assert (name, run(words)) == ("steptwin", 0), words
    Path("pick.toml").write_text(program.replace('"ar4-mk3"', '"my-ar4.toml"'), encoding="utf-8")
    assert run(["check", "pick.toml"]) == 0
    assert (tmp_path / "out" / "pick" / "report.json").exists()
