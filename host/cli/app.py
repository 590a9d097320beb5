"""The command line's frame: one typer app, one place where errors become one line and an exit code."""

import gc
import logging
import sys
from typing import Final

import typer
from typer.exceptions import TyperException

from steptwin.host.common.errors import InputError, StepTwinError

app = typer.Typer(
    name="steptwin",
    help="A firmware-faithful twin of STM32 + TB6560 stepper boards: plan, stream over CAN, emulate, verify.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


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
