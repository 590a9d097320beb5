"""The process of `serve --panel`: it imports the panel's modules, then runs the command from its standard input.

The command's words come as one line of JSON. The input ends when the server does, however it has ended; then the panel
ends too.
"""

import json
import os
import signal
import sys
from threading import Thread
from typing import Final

_READ_BYTES: Final = 4096


def main() -> int:
    """Wait for the words of a command and run it; return its exit code, 0 if no words come."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the panel handles it, Ctrl-C ends this process silently
    from steptwin.features.panel.page import hub, server
    from steptwin.host.cli.app import main as run

    del hub, server  # imported now, while the server prepares its board
    line = sys.stdin.readline()
    if not line:
        return 0
    sys.argv[1:] = json.loads(line)
    Thread(target=_follow_the_server, name="follow the server", daemon=True).start()
    return run()


def _follow_the_server() -> None:
    """End this process, as SIGTERM does, when its standard input has ended."""
    while os.read(sys.stdin.fileno(), _READ_BYTES):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main())
