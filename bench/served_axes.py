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
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.served_board import ServedBoard


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
