"""The command line's frame: one typer app, one place where errors become one line and an exit code."""

import sys
from typing import Final

import typer

from host.errors import InputError, StepTwinError

EXIT_INTERRUPTED: Final = 130

app = typer.Typer(
    name="steptwin",
    help="A firmware-faithful twin of STM32 + TB6560 stepper boards: plan, stream over CAN, emulate, verify.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command; return its exit code. Whatever went wrong is said in one line on stderr."""
    try:
        return int(app(args=arguments, standalone_mode=False) or 0)
    except StepTwinError as error:
        return _complain(str(error), error.exit_code)
    except KeyboardInterrupt:
        return _complain("interrupted", EXIT_INTERRUPTED)
    except typer.Abort:
        return _complain("interrupted", EXIT_INTERRUPTED)
    except Exception as error:
        message = getattr(error, "format_message", None)  # a usage error of the option parser
        if message is None:
            raise
        return _complain(message(), InputError.exit_code)


def _complain(message: str, exit_code: int) -> int:
    print(f"steptwin: {' '.join(message.split())}", file=sys.stderr)
    return exit_code
