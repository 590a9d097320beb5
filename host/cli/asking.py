"""Ask the user on a terminal."""

import sys
from collections.abc import Callable

import typer

from steptwin.host.cli.output import say
from steptwin.host.common.errors import InputError


def on_terminal() -> bool:
    """Return True if there is a terminal on which a user can be asked."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def ask(question: str, usual: str | None, check: Callable[[str], object]) -> str:
    """Ask until the answer passes the check; an empty answer is the usual one, where there is one."""
    while True:
        text = str(typer.prompt(question, default=usual)).strip()
        try:
            check(text)
        except InputError as error:
            say(str(error))
        else:
            return text
