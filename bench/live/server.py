"""Start a live board in a process of its own, so that a benchmark measures it as its clients see it.

No robot of the collection has seven axes for `steptwin serve`. As with that command, stderr names the port and stdout
gets the report.
"""

import gc
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import can

from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.studies.step_methods.loads import AXES
from steptwin.host.twin.live.served_board import ServedBoard


def seven_axes() -> Robot:
    """Return the warehouse robot without switches, its last joint repeated until there are seven."""
    robot = load_robot("warehouse-scara")
    joints = [replace(joint, switches=JointSwitches(), homing=None) for joint in robot.joints]
    more = [replace(joints[-1], name=f"more{i}") for i in range(AXES - len(joints))]
    return replace(robot, joints=(*joints, *more), home=(*robot.home, *[0.0] * len(more)))


def main() -> None:
    """Serve on a free port; print the report when the signal has come."""
    served = ServedBoard(seven_axes(), port=0)
    signal.signal(signal.SIGTERM, lambda _number, _frame: served.stop())
    print(f"port={served.port}", file=sys.stderr, flush=True)
    gc.freeze()
    served.serve_forever()
    print(json.dumps(served.report()))


if __name__ == "__main__":
    main()


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
