"""`steptwin estop ROBOT --connect ...`: stop all axes of a live board, then switch their power off."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.live.connection import NOT_CONNECTED, BoardAddress, stop_axes


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0")
def estop(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    board: BoardAddress = NOT_CONNECTED,
    as_json: AsJson = False,
) -> None:
    """Stop all axes together, switch their power off and hold them until `steptwin reset`.

    This is stop category 1 of IEC 60204-1, in software: it does not replace an emergency stop switch.
    """
    from steptwin.host.operate.recovering import emergency_stop

    stop_axes(one_robot(robot, robot_file), emergency_stop, board, as_json=as_json)
