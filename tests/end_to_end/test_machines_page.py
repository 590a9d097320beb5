"""The page of the brought machines: each session shows what its command prints."""

import shlex

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT, blocks_of, read_page

SESSIONS = [text for language, text in blocks_of(read_page("docs/machines.md")) if language == "console"]


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session.splitlines()[0][2:60])
def test_a_session_is_what_its_command_prints(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, session: str
) -> None:
    """All but the line with the time that it took."""
    monkeypatch.chdir(ROOT)
    command, *shown = session.splitlines()
    assert run(shlex.split(command.removeprefix("$ steptwin "))) == (": FAILED" in session)
    printed = capsys.readouterr().out.splitlines()
    assert [line.rstrip() for line in printed if not line.startswith("SIMULATED ")] == shown
