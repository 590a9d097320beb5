"""Serve a live board of seven axes until SIGTERM: `python -m steptwin.bench.served_axes`.

No robot of the collection has seven axes for `steptwin serve`. As with that command, stderr names the port and stdout
gets the report.
"""

import gc
import json
import signal
import sys
from dataclasses import replace

from steptwin.bench.loads import AXES
from steptwin.controller.backend import fastest_kernel
from steptwin.emulator.live_loop import LiveLoop
from steptwin.host.robots import load_robot
from steptwin.host.robots.homing import JointSwitches
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.endpoints import SocketcandEndpoint
from steptwin.host.twin.live_board import RECORD_EVERY_S, LiveBoard


def seven_axes() -> Robot:
    """Return the warehouse robot without switches, its last joint repeated until there are seven."""
    robot = load_robot("warehouse-scara")
    joints = [replace(joint, switches=JointSwitches(), homing=None) for joint in robot.joints]
    more = [replace(joints[-1], name=f"more{i}") for i in range(AXES - len(joints))]
    return replace(robot, joints=(*joints, *more), home=(*robot.home, *[0.0] * len(more)))


def main() -> None:
    """Serve on a free port; print the report when the signal has come."""
    robot = seven_axes()
    endpoint = SocketcandEndpoint("127.0.0.1", 0, allow_remote=False)
    board = LiveBoard(robot, list(robot.home), fastest_kernel(), bitrate=robot.board.bitrate, speed=1.0)
    with LiveLoop(board.live) as loop:
        signal.signal(signal.SIGTERM, lambda _number, _frame: loop.stop())
        endpoint.attach(loop)
        loop.call_every(RECORD_EVERY_S, board.record)
        print(f"port={endpoint.port}", file=sys.stderr, flush=True)
        gc.freeze()
        loop.run()
        endpoint.close()
    board.record()
    print(json.dumps(board.report() | {endpoint.kind: endpoint.figures()}))


if __name__ == "__main__":
    main()
