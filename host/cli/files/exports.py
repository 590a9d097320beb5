"""`steptwin eds`, `dbc [ROBOT]` and `kernel-c DIR`: describe the boards for other tools; their motion kernel as C."""

from dataclasses import MISSING
from pathlib import Path

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, RobotFile, RobotName, RobotOptions, keep_files
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import print_text, say


@command("", "> axis.eds")
def eds() -> None:
    """Print the axis nodes' electronic data sheet (CiA 306)."""
    from steptwin.protocol.exports import render_eds

    print_text(render_eds())


@command("", "lab-scara > arm.dbc")
def dbc(robot: RobotName = None, robot_file: RobotFile = None) -> None:
    """Print a CAN database (DBC): a robot's axes in mm and degrees, or eight axes in wire units."""
    from steptwin.host.robots.robot import AXES_MAX
    from steptwin.protocol.exports import AxisNames, render_dbc

    if robot is None and robot_file is None:
        axes = tuple(AxisNames(f"Axis{i}") for i in range(AXES_MAX))
    else:
        loaded = RobotOptions(robot_file=robot_file).robot(robot)
        axes = tuple(
            AxisNames(joint.name, joint.unit, joint.transmission.wire_units_per_unit, loaded.axis_position_text(i))
            for i, joint in enumerate(loaded.axes)
        )
    print_text(render_dbc(axes))


@command("firmware/kernel", ".")
def kernel_c(
    folder: str = argument("DIR", "Folder to write the files into; made if missing.", MISSING),
    replace: Replace = False,
) -> None:
    """Write the firmware's motion kernel as C11: header, source, an example and a README with units and limits."""
    from steptwin.host.common.whole_file import write_whole
    from steptwin.host.twin.machine.kernels import kernel_files

    target, files = Path(folder), kernel_files()
    keep_files((target / name for name in files), replace=replace)
    target.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(target / name, text)
    say(f"the kernel is in {target}/: begin with README.md")
