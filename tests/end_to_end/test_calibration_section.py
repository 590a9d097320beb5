"""The calibration in docs/machines.md: its commands, run one after the other, print what it shows; its program runs."""

import re
import shlex
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import blocks_of, read_page, run_python

_, _, PAGE = read_page("docs/machines.md").partition("## Calibration")
BLOCKS = blocks_of(PAGE)
(PROGRAM,) = [text for language, text in BLOCKS if language == "python"]
(ERRORS,) = [text for language, text in BLOCKS if language == "toml"]
SESSION = "".join(text for language, text in BLOCKS if language == "console")
COMMANDS = [command.splitlines() for command in re.split(r"^\$ ", SESSION, flags=re.MULTILINE)[1:]]


@pytest.mark.slow
def test_the_commands_print_what_the_page_shows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    Path("errors.toml").write_text(ERRORS, encoding="utf-8")
    assert len(COMMANDS) == 6
    for command, *shown in COMMANDS:
        program, *words = shlex.split(command)
        if program == "cat":
            *parts, redirection, whole = words
            assert redirection == ">"
            Path(whole).write_text("".join(Path(part).read_text(encoding="utf-8") for part in parts), encoding="utf-8")
            continue
        assert program == "steptwin"
        assert run(words) == 0, command
        captured = capsys.readouterr()
        assert (captured.out.splitlines(), captured.err) == (shown, ""), command


def test_the_program_runs(tmp_path: Path) -> None:
    assert run_python(PROGRAM, tmp_path)["found"].rank == 8
