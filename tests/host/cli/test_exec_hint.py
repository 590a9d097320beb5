"""What `--exec` says of a program that cannot find SocketCAN without the library that leads it to the board."""

import pytest
import typer

from steptwin.host.cli.live.served_programs import CommandOptions, ServedCommand


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (
            "false vcan0",
            "--exec false vcan0: ended with exit code 1; for it to find the board as vcan0, --preload canshim.so"
            " (docs/masters.md)\n",
        ),
        ("false", ""),
    ],
)
def test_a_program_of_socketcan_is_told_of_the_library(
    words: str, hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ServedCommand(CommandOptions(words=words, preload=None), None)
    command.exit_code = 1
    with pytest.raises(typer.Exit):
        command.pass_on()
    assert capsys.readouterr().err.removeprefix("steptwin: ") == hint
