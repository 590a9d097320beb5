"""The command line's frame: one typer app, one way for a command to join it, one line and an exit code for an error."""

import gc
import logging
import sys
from collections.abc import Callable
from typing import Annotated, Final, TypeVar

import typer
from typer.exceptions import TyperException

from steptwin.host.cli.help_page import Command, Commands, paragraphs
from steptwin.host.common.errors import InputError, StepTwinError

app = typer.Typer(
    name="steptwin",
    cls=Commands,
    help="A firmware-faithful twin of STM32 + TB6560 stepper boards: plan, stream over CAN, emulate, verify.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

COMMANDS: Final = {
    "Robots and maths": ("robots", "jobs", "fk", "ik", "workspace"),
    "Run and verify": ("run", "verify", "bench"),
    "Live board": (
        *("serve", "doctor", "status", "monitor", "home", "move", "jog"),
        *("pause", "resume", "stop", "estop", "reset", "outputs"),
    ),
    "Files and tools": ("trace", "plot", "eds", "dbc"),
}
"""Each command, under its group and in the order of `steptwin --help`. Each is a module of this package."""

EXAMPLES: Final[dict[str, tuple[str, ...]]] = {}
"""The examples in each command's help."""

_Function = TypeVar("_Function", bound=Callable[..., None])


def command(*examples: str, negative_numbers: bool = False) -> Callable[[_Function], _Function]:
    """Return a decorator that adds a function to the command line, by its name and with its docstring as help.

    Args:
        examples: command lines, shown at the end of its help.
        negative_numbers: its arguments may be negative numbers, which otherwise look like options.
    """

    def add(function: _Function) -> _Function:
        EXAMPLES[function.__name__] = examples
        register = app.command(
            cls=Command,
            rich_help_panel=next(group for group, names in COMMANDS.items() if function.__name__ in names),
            help=paragraphs(function.__doc__ or ""),
            epilog="\n".join(["Examples:", *examples]),
            context_settings={"ignore_unknown_options": negative_numbers},
        )
        return register(function)

    return add


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"steptwin {version('steptwin')}")
        raise typer.Exit


@app.callback()
def _of_the_program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options of `steptwin` itself, before a command."""


_YOUNG_OBJECTS: Final = 50_000
"""So many more before garbage is collected: a command makes little of it, but its imports make objects that stay."""


def main() -> None:
    """Run the command line and leave with its exit code."""
    gc.set_threshold(_YOUNG_OBJECTS)
    sys.exit(run(sys.argv[1:]))


# What the libraries have to say reaches the user as our own one line; without a handler it would print a second one.
for library in ("can", "canopen"):
    logging.getLogger(library).addHandler(logging.NullHandler())


def run(arguments: list[str]) -> int:
    """Run one command; return its exit code, 130 if interrupted. Whatever went wrong is one line on stderr."""
    try:
        return int(app(args=arguments, standalone_mode=False) or 0)
    except StepTwinError as error:
        return _complain(str(error), error.exit_code)
    except TyperException as error:  # usage: an unknown command or option, a missing argument, or no command at all
        return _complain(error.format_message(), InputError.exit_code)
    except OSError as error:
        return _complain(f"{error.filename or 'output'}: {error.strerror}", InputError.exit_code)


def _complain(message: str, exit_code: int) -> int:
    if message:
        message = message.replace("Value error, ", "")  # so the parser's library begins what our own types say
        typer.echo(f"steptwin: {' '.join(message.split())}", err=True)
    return exit_code
