"""A `steptwin serve` for a benchmark, as a process of its own."""

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
_SERVE: Final = [
    sys.executable,
    "-c",
    "from steptwin.host.cli import main; main()",
    "serve",
    ROBOT,
    "--port",
    "0",
    "--json",
]


class Server:
    """It serves at `port` until `end`."""

    def __init__(self, *options: str) -> None:
        self.process = subprocess.Popen([*_SERVE, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr
        banner = "".join(self.process.stderr.readline() for _ in range(3))
        found = re.search(r"port=(\d+)", banner)
        assert found, banner
        self.port = int(found[1])

    def client(self) -> can.BusABC:
        """A new connection of python-can."""
        return can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=self.port, tcp_tune=True)

    def end(self) -> dict[str, Any]:
        """Its report."""
        self.process.send_signal(signal.SIGTERM)
        report: dict[str, Any] = json.loads(self.process.communicate()[0])
        return report


@contextmanager
def serving(*options: str) -> Iterator[Server]:
    """A server that is gone afterwards, whatever happens."""
    server = Server(*options)
    try:
        yield server
    finally:
        server.process.kill()
        server.process.wait()
