"""`steptwin pause ROBOT --connect ...`: halt the trajectory that runs on a live board."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.live.connection import NOT_CONNECTED, BoardAddress, Force, opened_session
from steptwin.host.cli.output import print_json, say


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0")
def pause(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    board: BoardAddress = NOT_CONNECTED,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Halt the running trajectory on its path; the program that streams it keeps the queue filled."""
    from steptwin.host.client.pausing import pause_trajectory
    from steptwin.host.client.stopping import saying_if_unsure

    loaded = one_robot(robot, robot_file)
    with saying_if_unsure(), opened_session(loaded, board, force=force) as session:
        session.require_present()
        halted = pause_trajectory(session.machine)
    if as_json:
        print_json({"robot": loaded.name, "halted": halted})
    else:
        say("halted" if halted else "not halted: the trajectory ended first")
