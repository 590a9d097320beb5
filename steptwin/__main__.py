"""Run the command line, as `steptwin` or `python -m steptwin`.

Ctrl-C while the program is still being imported, or while it is ending, leaves at once: there is nothing to put in
order then, and Python would print a traceback, or drop the interrupt in one of its callbacks. So nothing heavy is
imported before `main` has seen to that.
"""

import os
import sys

_INTERRUPTED = 130
"""Exit code of a program that SIGINT has ended, as shells count: 128 + 2."""


def main() -> None:
    """Run the command line and leave with its exit code."""
    try:
        import signal

        interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # not behind `nohup` and the like
        if interruptible:
            signal.signal(signal.SIGINT, _leave)
        from steptwin.host.cli import main as run

        if interruptible:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        exit_code = run()
        if interruptible:
            signal.signal(signal.SIGINT, _leave)
    except KeyboardInterrupt:
        _leave()
    sys.exit(exit_code)


def _leave(*_: object) -> None:
    os._exit(_INTERRUPTED)


if __name__ == "__main__":
    main()
