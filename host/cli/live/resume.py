"""`steptwin resume ROBOT --connect ...`: continue the trajectory that was halted on a live board."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.live.connection import NOT_CONNECTED, BoardAddress, Force, opened_session
from steptwin.host.cli.output import print_json, say


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0")
def resume(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    board: BoardAddress = NOT_CONNECTED,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Continue a halted trajectory."""
    from steptwin.host.client.pausing import resume_trajectory

    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, board, force=force) as session:
        session.require_present()
        resume_trajectory(session.machine)
    if as_json:
        print_json({"robot": loaded.name, "halted": False})
    else:
        say("goes on")
