"""Every command on every page is one that today's `steptwin` takes: names, options, choices, numbers of arguments."""

import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from steptwin.host.cli.app import command_named
from steptwin.host.cli.commands import command_table
from tests.end_to_end.pages import ROOT, blocks_of

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs/papers").glob("*.md"))]
_OF_THE_SHELL = {">", ">>", "|", "&", "&&", "<", "2>"}
_NO_COMMANDS = ("view | plot | verify | replay",)
"""Lines that name several commands at once: what pytest prints of a failed test."""


def written_commands(text: str) -> Iterator[list[str]]:
    """Yield the words of each line of a block that begins with `steptwin`, up to what is the shell's."""
    for _, block in blocks_of(text):
        for line in block.replace("\\\n", " ").splitlines():
            command = line.strip().removeprefix("$ ")
            if command.startswith("steptwin ") and "[OPTIONS]" not in line and not any(s in line for s in _NO_COMMANDS):
                words = shlex.split(command, comments=True)[1:]
                end = next((index for index, word in enumerate(words) if word in _OF_THE_SHELL), len(words))
                yield words[:end]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_are_known(page: Path) -> None:
    """Parsed as if it were run, without running it: an unknown option or a word that is no choice raises."""
    for words in written_commands(page.read_text(encoding="utf-8")):
        name, *rest = words
        assert name in command_table(), words
        command = command_named(name)
        if "--help" not in rest:
            command.make_context(name, rest)


def test_there_are_many() -> None:
    assert sum(len(list(written_commands(page.read_text(encoding="utf-8")))) for page in PAGES) > 300
