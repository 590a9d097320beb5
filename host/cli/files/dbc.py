"""`steptwin dbc [ROBOT]`: print the CAN database for loggers and analysers."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotFile, RobotName, one_robot
from steptwin.host.cli.output import print_text


@command("", "lab-scara > arm.dbc")
def dbc(robot: RobotName = None, robot_file: RobotFile = None) -> None:
    """Print a CAN database (DBC): a robot's axes in mm and degrees, or eight axes in wire units."""
    from steptwin.host.robots.robot import AXES_MAX
    from steptwin.protocol.dbc import AxisNames, render_dbc

    if robot is None and robot_file is None:
        axes = tuple(AxisNames(f"Axis{i}") for i in range(AXES_MAX))
    else:
        loaded = one_robot(robot, robot_file)
        axes = tuple(
            AxisNames(joint.name, joint.unit, joint.transmission.wire_units_per_unit, loaded.axis_position_text(i))
            for i, joint in enumerate(loaded.joints)
        )
    print_text(render_dbc(axes))
