"""`--help` of the program and of every command: its groups, its width, its words, and its examples."""

import re
import shlex
from collections import Counter
from pathlib import Path

import pytest
from typer.core import TyperOption

from steptwin.host.cli.app import command_named, run
from steptwin.host.cli.commands import command_table
from steptwin.host.common.errors import BusError
from steptwin.host.common.features import CommandRow, Feature
from steptwin.host.robots import load_robot

NAMES = list(command_table())
EVERY_EXAMPLE = [(name, example) for name in NAMES for example in command_named(name).examples]
CHEAP = {"robots", "jobs", "fk", "ik", "eds", "dbc"}
WAITING = {"panel"}
"""Commands that wait for their board instead of ending without it."""
LIVE = [
    (name, example)
    for name, example in EVERY_EXAMPLE
    if re.search(" --connect | -i | --control ", example) and name not in WAITING
]


def shown(capsys: pytest.CaptureFixture[str], *words: str) -> list[str]:
    assert run([*words, "--help"]) == 0
    return [line.rstrip() for line in capsys.readouterr().out.splitlines()]


def words_of(example: str) -> list[str]:
    """Return the words of an example after the program's name, without a redirection of its output."""
    program, *words = shlex.split(example.partition(" > ")[0])
    assert program == "steptwin"
    return words


def test_the_program_lists_its_commands_in_groups(capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown(capsys)
    titles = [line.strip("╭╮─ ") for line in lines if line.startswith("╭")]
    assert titles == ["Options", "Robots and maths", "Run and verify", "Live board", "Files and tools"]
    table = command_table()
    listed = [line.split()[1] for line in lines if re.match(r"│ [a-z]", line)]
    assert listed == [name for name in NAMES if table[name].usual]
    assert len(listed) <= 30
    assert max(Counter(table[name].group for name in listed).values()) <= 10
    text = re.sub(r"[│\s]+", " ", "\n".join(lines))
    others = [name for named in re.findall(r"also: ([\w, -]+?)(?= ╰)", text) for name in named.split(", ")]
    assert sorted([*listed, *others]) == sorted(NAMES)
    assert len(NAMES) == len(set(NAMES)) == 44


def test_a_command_that_there_cannot_be_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = (CommandRow("run", "Live board", "", "mine.run"), CommandRow("spin", "Toys", "", "mine.spin"))
    monkeypatch.setattr("steptwin.host.cli.commands.giving", lambda _: [(Feature(name="mine"), rows)])
    assert command_table()["run"].module == "steptwin.host.cli.run.run"
    assert run(["robots"]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "steptwin: feature mine: command run: there is one in steptwin.host.cli.run.run",
        "steptwin: feature mine: command spin: no group 'Toys'",
    ]


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert re.fullmatch(r"steptwin \d+\.\d+\.\d+\n", capsys.readouterr().out)


@pytest.mark.parametrize("name", ["", *NAMES])
def test_it_fits_80_columns(name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """No line is longer, and no name of an option or of its value is broken over two lines."""
    monkeypatch.setenv("COLUMNS", "80")
    lines = shown(capsys, *name.split())
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    assert "…" not in text
    assert not re.search(r"<\w", text), "a type of Python instead of a word"
    for option in command_named(name).params if name else []:
        for word in (*option.opts, *(option.metavar or "").split()) if isinstance(option, TyperOption) else ():
            assert re.search(rf"│ .*{re.escape(word)}", text), word


@pytest.mark.parametrize("name", NAMES)
def test_it_ends_with_two_examples(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [line.strip() for line in shown(capsys, name)]
    at = lines.index("Examples:")
    examples = command_named(name).examples
    assert lines[at + 1 : at + 3] == examples
    assert len(set(examples)) == 2
    assert all(words_of(example)[0] == name for example in examples)


@pytest.mark.parametrize("name", NAMES)
def test_its_line_in_the_table_is_its_summary(name: str) -> None:
    assert (command_named(name).help or "").partition("\n\n")[0] == command_table()[name].help


@pytest.mark.parametrize(("name", "example"), EVERY_EXAMPLE, ids=[example for _, example in EVERY_EXAMPLE])
def test_an_example_is_understood(name: str, example: str) -> None:
    """Its options exist and their values are of the right kind; robots and joints are looked up later."""
    command_named(name).make_context(name, words_of(example)[1:])


@pytest.mark.parametrize("example", [example for name, example in EVERY_EXAMPLE if name in CHEAP])
def test_an_example_runs(example: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    for file in ("mine.toml", "my-arm.toml"):
        Path(file).write_text(load_robot("ar4-mk3").toml, encoding="utf-8")
    assert run(words_of(example)) == 0


@pytest.mark.parametrize("example", [example for _, example in LIVE])
def test_an_example_for_a_live_board_gets_as_far_as_the_bus(
    example: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Robot, joints, numbers and options are right: the first error is the missing bus."""

    def no_bus(*_: object) -> None:
        raise BusError("no bus in this test")

    monkeypatch.setattr("steptwin.host.client.links.bus_link.open_bus", no_bus)
    monkeypatch.setattr("steptwin.host.client.control_client.connected", no_bus)
    assert run(words_of(example)) == BusError.exit_code
    assert "no bus in this test" in "".join(capsys.readouterr())
