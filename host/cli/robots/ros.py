"""`steptwin urdf ROBOT` and `ros2 ROBOT --out DIR`: describe a robot for ROS tools, and its board for ros2_canopen."""

from dataclasses import MISSING
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
    from steptwin.host.robots.urdf.urdf_export import urdf_of

    text = urdf_of(RobotOptions(robot_file=robot_file).robot(robot))
    if out is None:
        print_text(text)
        return
    keep_files([Path(out)], replace=replace)
    write_whole(Path(out), text)
    say(f"{out}: the robot from base_link to tool0")


@command("teaching-scara --out my_arm/config", "my-arm.toml --out my_arm/config --replace")
def ros2(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    out: str = option("DIR", "Folder to write the files into; made if missing.", default=MISSING),
    replace: Replace = False,
) -> None:
    """Write what ros2_canopen needs: bus.yml with scales and settings, the EDS, ros2_control's tag, the URDF."""
    from steptwin.host.operate.ros2_files import ros2_files

    files = ros2_files(RobotOptions(robot_file=robot_file).robot(robot))
    target = Path(out)
    keep_files((target / name for name in files), replace=replace)
    target.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(target / name, text)
    say(f"for ros2_canopen, in {target}/: {', '.join(files)}; begin with README.md")
