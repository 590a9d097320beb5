"""The option that names a file of positions, and the saved position that a command is to use."""

from typing import TYPE_CHECKING, Annotated

import typer

from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.planning.programs.positions import Position
    from steptwin.host.robots.robot import Robot

PositionsFile = Annotated[
    str | None,
    typer.Option(
        "--file", metavar="FILE", help="File of saved positions; by default ROBOT-positions.toml in the working folder."
    ),
]


def positions_path(robot: "Robot", file: str | None) -> str:
    """Return the file of a robot's positions."""
    from steptwin.host.planning.programs.position_file import default_file

    return default_file(robot) if file is None else file


def saved_position(robot: "Robot", name: str | None, file: str | None) -> "Position | None":
    """Return the position that --to and --file name; None without --to. Raises InputError if there is none."""
    from steptwin.host.planning.programs.position_file import find_position, read_positions

    if name is None:
        if file is not None:
            raise InputError(f"--file {file}: is for --to NAME")
        return None
    path = positions_path(robot, file)
    return find_position(read_positions(path, robot), name, path)
