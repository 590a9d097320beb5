"""`steptwin ros2 ROBOT --out DIR`: describe a robot's board for ros2_canopen."""

from dataclasses import MISSING
from pathlib import Path

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, RobotFile, RobotName, RobotOptions, keep_files
from steptwin.host.cli.options import option
from steptwin.host.cli.output import say
from steptwin.host.common.whole_file import write_whole


@command("teaching-scara --out my_arm/config", "my-arm.toml --out my_arm/config --replace")
def ros2(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    out: str = option("DIR", "Folder to write the files into; made if missing.", default=MISSING),
    replace: Replace = False,
) -> None:
    """Write what ros2_canopen needs: bus.yml with scales and settings, the EDS, ros2_control's tag, the URDF."""
    from steptwin.features.ros2.ros2_files import ros2_files

    files = ros2_files(RobotOptions(robot_file=robot_file).robot(robot))
    target = Path(out)
    keep_files((target / name for name in files), replace=replace)
    target.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(target / name, text)
    say(f"for ros2_canopen, in {target}/: {', '.join(files)}; begin with README.md")
