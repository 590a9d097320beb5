"""`steptwin stop ROBOT --connect ...`: stop all axes of a live board together."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.live.connection import NOT_CONNECTED, BoardAddress, stop_axes


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0")
def stop(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    board: BoardAddress = NOT_CONNECTED,
    as_json: AsJson = False,
) -> None:
    """Stop all axes together by a quick stop; they hold their positions afterwards."""
    from steptwin.host.operate.recovering import stop

    stop_axes(one_robot(robot, robot_file), stop, board, as_json=as_json)
