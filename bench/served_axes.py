"""A live board of seven axes as a program of its own: `python -m steptwin.bench.served_axes`. It ends with SIGTERM.

What `steptwin serve` runs, for a machine with more axes than any robot of the collection has. Its first line on stdout
is the port; its last one the report.
"""

import gc
import json
import signal
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
    """The warehouse robot without its switches, its last joint there as often as it takes."""
    robot = load_robot("warehouse-scara")
    joints = [replace(joint, switches=JointSwitches(), homing=None) for joint in robot.joints]
    more = [replace(joints[-1], name=f"more{i}") for i in range(AXES - len(joints))]
    return replace(robot, joints=(*joints, *more), home=(*robot.home, *[0.0] * len(more)))


def main() -> None:
    """Serve until the signal."""
    robot = seven_axes()
    endpoint = SocketcandEndpoint("127.0.0.1", 0, allow_remote=False)
    board = LiveBoard(robot, list(robot.home), fastest_kernel(), bitrate=robot.board.bitrate, speed=1.0)
    with LiveLoop(board.live) as loop:
        signal.signal(signal.SIGTERM, lambda _number, _frame: loop.stop())
        endpoint.attach(loop)
        loop.call_every(RECORD_EVERY_S, board.record)
        print(endpoint.port, flush=True)
        gc.freeze()
        loop.run()
        endpoint.close()
    board.record()
    print(json.dumps(board.report() | {endpoint.kind: endpoint.figures()}))


if __name__ == "__main__":
    main()
