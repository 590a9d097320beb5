"""The frame of the command line: commands join one typer app, and an error becomes one line and an exit code."""

import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from io import TextIOWrapper
from typing import Annotated, Any, Final, NamedTuple, TypeVar

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup
from typer.exceptions import TyperException

from steptwin import __version__
from steptwin.host.cli.options import with_groups
from steptwin.host.cli.output import say
from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.common.features import broken_features
from steptwin.host.common.processes import collect_seldom

VALUES_ALONE: Final[dict[str, dict[str, str]]] = {}
"""By command, the options that may stand without a value, and the value that they have then."""


class CliCommand(TyperCommand):
    """A command whose help names arguments by words such as FILE, and whose options may stand alone."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, list(_with_values(args, VALUES_ALONE.get(self.name or "", {}))))

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        named = (each.display_name_raw for each in self.get_params(ctx) if isinstance(each, TyperArgument))
        return [self.options_metavar or "", *named]

    def format_help(self, ctx: Any, _formatter: Any) -> None:
        _print_help(self, ctx)


class Commands(TyperGroup):
    """The program itself, `steptwin`, with the same help."""

    def format_help(self, ctx: Any, _formatter: Any) -> None:
        _print_help(self, ctx)


def _with_values(words: Sequence[str], alone: dict[str, str]) -> Iterator[str]:
    """Yield the words of a command line; an option that stands alone gets its value."""
    for index, word in enumerate(words):
        if word == "--":
            yield from words[index:]
            return
        yield f"{word}={alone[word]}" if word in alone else word


def _print_help(command: TyperCommand | TyperGroup, context: Any) -> None:
    from steptwin.host.cli.help_layout import print_help

    print_help(command, context)


app: Final = typer.Typer(
    name="steptwin",
    cls=Commands,
    help="A firmware-faithful twin of STM32 + TB6560 stepper boards: plan, stream over CAN, emulate, verify.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


class Group(NamedTuple):
    """A group of commands in `steptwin --help`: a room here, with its modules as their commands stand there."""

    title: str
    room: str
    modules: str


GROUPS: Final = (
    Group("Robots and maths", "robots", "listing poses workspace calibrate ros"),
    Group("Run and verify", "run", "new check run verify campaign"),
    Group("Live board", "live", "serve panel status monitor shadow move positions halting inject ros2_bridge"),
    Group("Files and tools", "files", "trace plot motors show replay exports"),
)

EXAMPLES: Final[dict[str, list[str]]] = {}
"""The two examples in each command's help."""

_Function = TypeVar("_Function", bound=Callable[..., None])


def command(
    *examples: str, negatives: bool = False, alone: dict[str, str] | None = None
) -> Callable[[_Function], _Function]:
    """Return a decorator that adds a function to the command line, by its name and with its docstring as help.

    Args:
        examples: the words behind the command's name in each example at the end of its help.
        negatives: its arguments may be negative numbers, which otherwise look like options.
        alone: its options that may stand without a value, and the value that they have then.
    """

    def add(function: _Function) -> _Function:
        name = function.__name__.replace("_", "-")
        room = function.__module__.split(".")[-2]
        VALUES_ALONE[name] = alone or {}
        EXAMPLES[name] = [f"steptwin {name} {words}".rstrip() for words in examples]
        register = app.command(
            cls=CliCommand,
            rich_help_panel=next(group.title for group in GROUPS if group.room == room),
            help="\n\n".join(" ".join(text.split()) for text in (function.__doc__ or "").split("\n\n")),
            epilog="\n".join(["Examples:", *EXAMPLES[name]]),
            context_settings={"ignore_unknown_options": negatives},
        )
        register(with_groups(function))
        return function

    return add


_NOT_RIGHT: Final = 1
"""Exit code of a command whose answer is that something is not as it should be."""


def end_unless(right: bool) -> None:
    """End the command with exit code 1 if what it has found is not right."""
    if not right:
        raise typer.Exit(_NOT_RIGHT)


def _print_version(wanted: bool) -> None:
    if wanted:
        say(f"steptwin {__version__}")
        raise typer.Exit


@app.callback()
def _of_the_program(
    version: Annotated[  # noqa: ARG001, typer calls back for it
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options of `steptwin` itself, which stand before a command, and tell of features that are broken."""
    for reason in broken_features().values():
        say(f"steptwin: {reason}", err=True)


_INTERRUPTED: Final = 130
"""Exit code of a command that Ctrl-C has ended, as shells count: 128 + 2."""


def main() -> int:
    """Run the command line of this process; return its exit code."""
    collect_seldom()
    if isinstance(sys.stdout, TextIOWrapper):  # on a terminal with few characters the others are escaped
        sys.stdout.reconfigure(errors="backslashreplace")
    return run(sys.argv[1:])


# The user sees an error of these libraries as our one line; without a handler, logging would print it once more.
for library in ("can", "canopen"):
    logging.getLogger(library).addHandler(logging.NullHandler())


def run(arguments: list[str]) -> int:
    """Run one command and print an error as one line on stderr; return the exit code, 130 if interrupted."""
    try:
        return int(program()(args=arguments, standalone_mode=False) or 0)
    except StepTwinError as error:
        return _complain(str(error), error.exit_code)
    except typer.Abort:  # Ctrl-C or the end of the input, at a question
        say("", err=True)
        return _INTERRUPTED
    except TyperException as error:  # usage: an unknown command or option, a missing argument, or no command at all
        return _complain(error.format_message(), InputError.exit_code)
    except OSError as error:
        return _complain(f"{error.filename or 'output'}: {error.strerror}", InputError.exit_code)
    except MemoryError:
        return _complain("the input takes more memory than there is", InputError.exit_code)


@cache
def program() -> TyperGroup:
    """Return the parsers of all commands, built once for a process that runs several: that takes longer than most."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    return group


def _complain(message: str, exit_code: int) -> int:
    if message:
        message = message.replace("Value error, ", "")  # pydantic, which typer parses with, puts this in front
        say(f"steptwin: {' '.join(message.split())}", err=True)
    return exit_code
