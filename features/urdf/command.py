"""`steptwin urdf ROBOT`: describe a robot for ROS tools."""

from pathlib import Path

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, RobotFile, RobotName, RobotOptions, keep_files
from steptwin.host.cli.options import option
from steptwin.host.cli.output import print_text, say
from steptwin.host.common.whole_file import write_whole


@command("my-arm.toml > my-arm.urdf", "my-arm.toml --out my-arm.urdf")
def urdf(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    out: str | None = option("FILE", "File to write instead of printing it."),
    replace: Replace = False,
) -> None:
    """Print a robot of the kind chain as a URDF: frames, axes, limits and speeds of its joints, in m and rad.

    The last link, tool0, is the tool. A URDF has no place for transmissions, microsteps, drivers, switches and the
    base's place in the station: they are left out.
    """
    from steptwin.features.urdf.urdf_export import urdf_of

    text = urdf_of(RobotOptions(robot_file=robot_file).robot(robot))
    if out is None:
        print_text(text)
        return
    keep_files([Path(out)], replace=replace)
    write_whole(Path(out), text)
    say(f"{out}: the robot from base_link to tool0")
