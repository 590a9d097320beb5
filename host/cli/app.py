"""Frame of the command line: commands join one typer app, and an error becomes one line and an exit code."""

import logging
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from io import TextIOWrapper
from types import MappingProxyType
from typing import Annotated, Any, Final, TypeVar

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup
from typer.exceptions import TyperException
from typer.main import get_command_from_info
from typer.models import CommandInfo

from steptwin import __version__
from steptwin.host.cli.commands import command_table, refused_commands
from steptwin.host.cli.output import say
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.common.features import broken_features
from steptwin.host.common.processes import collect_seldom


class CliCommand(TyperCommand):
    """A command with placeholders such as FILE in its help, and with options that may stand without a value.

    Attributes:
        more: returns paragraphs at the end of its help.
        examples: examples at the end of its help.
        values_alone: default values of options without a value.
    """

    more: Callable[[], Iterable[str]] = tuple
    examples: Sequence[str] = ()
    values_alone: Mapping[str, str] = MappingProxyType({})

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, list(_with_values(args, self.values_alone)))

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        named = (each.display_name_raw for each in self.get_params(ctx) if isinstance(each, TyperArgument))
        return [self.options_metavar or "", *named]

    def format_help(self, ctx: Any, _formatter: Any) -> None:
        from steptwin.host.cli.help_layout import print_help

        print_help(self, ctx, self.paragraphs, ())

    @property
    def paragraphs(self) -> list[str]:
        """The paragraphs of its help."""
        return [*(self.help or "").split("\n\n"), *self.more()]


class Commands(TyperGroup):
    """The program `steptwin`; it imports the module of a command when the command is called."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        return list(command_table())

    def get_command(self, ctx: Any, cmd_name: str) -> "CliCommand | None":  # noqa: ARG002
        return command_named(cmd_name) if cmd_name in command_table() else None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[0] not in command_table():
            raise unknown("command", args[0], command_table())
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: Any, _formatter: Any) -> None:
        from steptwin.host.cli.help_layout import print_help

        print_help(self, ctx, [self.help or ""], command_table().values())


_imported: Final[dict[str, CliCommand]] = {}
"""Commands with imported modules, by name."""


def command_named(name: str) -> CliCommand:
    """Return a command of the table; import its module first."""
    import_module(command_table()[name].module)
    return _imported[name]


def _with_values(words: Sequence[str], alone: Mapping[str, str]) -> Iterator[str]:
    """Yield the words of a command line; an option without a value gets its default."""
    for index, word in enumerate(words):
        if word == "--":
            yield from words[index:]
            return
        yield f"{word}={alone[word]}" if word in alone else word


app: Final = typer.Typer(
    name="steptwin",
    cls=Commands,
    help="A firmware-faithful twin of STM32 + TB6560 stepper boards: plan, stream over CAN, emulate, verify.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


_Function = TypeVar("_Function", bound=Callable[..., None])


def command(
    *examples: str, negatives: bool = False, more: Callable[[], Iterable[str]] = tuple
) -> Callable[[_Function], _Function]:
    """Return a decorator that adds a function to the command line, with its name and its docstring as help.

    Args:
        examples: words after the command's name, for each example at the end of its help.
        negatives: True if its arguments may be negative numbers, which otherwise look like options.
        more: returns paragraphs of its help after those of the docstring.
    """

    def add(function: _Function) -> _Function:
        from steptwin.host.cli.options import with_groups  # `steptwin --help` does not list options of commands

        name = function.__name__.replace("_", "-")
        callback, alone = with_groups(function)
        texts = [f"steptwin {name} {words}".rstrip() for words in examples]
        info = CommandInfo(
            name,
            cls=CliCommand,
            callback=callback,
            help="\n\n".join(" ".join(text.split()) for text in (function.__doc__ or "").split("\n\n")),
            epilog="\n".join(["Examples:", *texts]),
            context_settings={"ignore_unknown_options": negatives},
        )
        made = get_command_from_info(info, pretty_exceptions_short=False, rich_markup_mode=None)
        assert isinstance(made, CliCommand)
        made.examples, made.values_alone, made.more = texts, alone, more
        _imported[name] = made
        return function

    return add


_NOT_RIGHT: Final = 1
"""Exit code of a command with a negative answer."""


def end_unless(right: bool) -> None:
    """End the command with exit code 1 if `right` is False."""
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
    """Handle the options of `steptwin` itself, before any command, and report broken features."""
    for reason in (*broken_features().values(), *refused_commands()):
        say(f"steptwin: {reason}", err=True)


_INTERRUPTED: Final = 130
"""Exit code of a command ended by Ctrl-C: 128 + 2, as in shells."""


def main() -> int:
    """Run the command line of this process; return its exit code."""
    collect_seldom()
    if isinstance(sys.stdout, TextIOWrapper):  # on a terminal with few characters the others are escaped
        sys.stdout.reconfigure(errors="backslashreplace")
    return run(sys.argv[1:])


# Errors of these libraries become our one line; without a handler, logging would print them, too.
for library in ("can", "canopen"):
    logging.getLogger(library).addHandler(logging.NullHandler())


def run(arguments: list[str]) -> int:
    """Run one command and print an error as one line on stderr; return the exit code, 130 if interrupted."""
    try:
        return int(program()(args=arguments, standalone_mode=False) or 0)
    except StepTwinError as error:
        return _complain(str(error), error.exit_code)
    except typer.Abort:  # Ctrl-C or the end of the input at a question
        say("", err=True)
        return _INTERRUPTED
    except TyperException as error:  # usage: an unknown command or option, a missing argument, or no command
        return _complain(error.format_message(), InputError.exit_code)
    except OSError as error:
        return _complain(f"{error.filename or 'output'}: {error.strerror}", InputError.exit_code)
    except MemoryError:
        return _complain("the input takes more memory than there is", InputError.exit_code)


@cache
def program() -> TyperGroup:
    """Return the parser of the program, made once for all commands of a process."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    return group


def _complain(message: str, exit_code: int) -> int:
    if message:
        message = message.replace("Value error, ", "")  # pydantic, typer's parser, adds this prefix
        say(f"steptwin: {' '.join(message.split())}", err=True)
    return exit_code
