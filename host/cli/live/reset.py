"""`steptwin reset ROBOT --connect ...`: reset the faults of a live board, start its nodes."""

import time
from typing import Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.live.axis_states import print_axis_states
from steptwin.host.cli.live.connection import NOT_CONNECTED, BoardAddress, Force, opened_session

_CLOCKS_S: Final = 0.5
"""Time for which the clock of an emulated board may have stood since a fault, on a computer that is too slow."""


@command("lab-scara --connect 127.0.0.1", "lab-scara --json --connect 127.0.0.1")
def reset(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    board: BoardAddress = NOT_CONNECTED,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Reset the drives' faults, and start nodes that are stopped; the drives are off afterwards.

    Nodes that another master has stopped (NMT), or whose board has restarted, are started. A fault or an emergency stop
    that comes after this command was started stays. Exit code 3: a cause persists, or a later fault stays.
    """
    asked_s = time.monotonic()
    from steptwin.host.operate.recovering import reset

    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, board, force=force, waking=True) as session:
        states = reset(session, age_s=max(0.0, time.monotonic() - asked_s - _CLOCKS_S))
    print_axis_states(loaded, states, as_json=as_json)
