"""Run the command line, as `steptwin` or `python -m steptwin`.

Ctrl-C while the program is still being imported, or while it is ending, leaves at once: there is nothing to put in
order then, and Python would print a traceback, or drop the interrupt in one of its callbacks. So nothing heavy is
imported before `main` has seen to that.
"""

import os
import sys
from typing import NoReturn

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
    _end(exit_code)


def _leave(*_: object) -> None:
    os._exit(_INTERRUPTED)


def _end(exit_code: int) -> NoReturn:
    """Do what the interpreter does at its end, but leave before it takes itself apart.

    While it does that, it may wait for ever for a thread that has asked for its lock and has ended, as threads do that
    sleep in a driver of python-can (github.com/python/cpython/issues/96387; what was done about it leaves a gap).
    """
    import atexit
    import threading

    lasting = any(thread is not threading.main_thread() and not thread.daemon for thread in threading.enumerate())
    if not lasting:  # else the interpreter has to wait for them
        atexit._run_exitfuncs()  # noqa: SLF001, it has no public name
        try:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
        except (OSError, ValueError):  # the interpreter says it
            sys.exit(exit_code)
        os._exit(exit_code)
    sys.exit(exit_code)


if __name__ == "__main__":
    main()
