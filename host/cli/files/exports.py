"""`steptwin eds`, `dbc [ROBOT]` and `schema KIND`: describe boards and files for other tools."""

from collections.abc import Callable
from typing import Annotated, Any

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotFile, RobotName, RobotOptions
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import print_json, print_text


@command("", "> axis.eds")
def eds() -> None:
    """Print the axis nodes' electronic data sheet (CiA 306)."""
    from steptwin.protocol.exports import render_eds

    print_text(render_eds())


@command("", "ar4-mk3 > arm.dbc")
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


@command("robot > robot.schema.json", "program > program.schema.json")
def schema(
    kind: Annotated[str, argument("KIND", "Kind of file, such as robot; another word lists all kinds.")],
) -> None:
    """Print the JSON schema of a kind of file, by which editors complete and check it."""
    from steptwin.host.common.bad_input import unknown
    from steptwin.host.common.features import giving
    from steptwin.host.common.file_models import json_schema
    from steptwin.host.planning.programs.program_file import program_model
    from steptwin.host.robots.reader import robot_model

    own: dict[str, Callable[[], type[Any]]] = {"robot": robot_model, "program": program_model}
    models = own | {name: model for _, given in giving("schemas") for name, model in given().items()}
    if kind not in models:
        raise unknown("kind of file", kind, models)
    print_json(json_schema(models[kind]()))
