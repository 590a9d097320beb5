"""Start a live board in a process of its own, so that a benchmark measures it as its clients see it."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import can

ROBOT: Final = "warehouse-scara"
SERVE: Final = ("steptwin", "serve", ROBOT, "--port", "0", "--json")


class Server:
    """A process that serves a board at `port` until `end`."""

    def __init__(self, module: str, *arguments: str) -> None:
        """Start `python -m MODULE ARGUMENTS`, which names its port on stderr and prints its report on stdout."""
        command = [sys.executable, "-m", module, *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr
        banner = ""
        while not (found := re.search(r"port=(\d+)", banner)):
            line = self.process.stderr.readline()
            assert line, f"the server ended: {banner}"
            banner += line
        self.port = int(found[1])

    def client(self) -> can.BusABC:
        """Open a new connection with python-can."""
        return can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=self.port, tcp_tune=True)

    def end(self) -> dict[str, Any]:
        """Stop the server and return its report."""
        self.process.send_signal(signal.SIGTERM)
        report: dict[str, Any] = json.loads(self.process.communicate()[0])
        return report


@contextmanager
def serving(module: str, *arguments: str) -> Iterator[Server]:
    """Run a server within the block; kill it afterwards if it is still running."""
    server = Server(module, *arguments)
    try:
        yield server
    finally:
        server.process.kill()
        server.process.wait()
