"""Find the robot that a program names, by its name or by the path of its file, which counts from the program's folder.

Every error begins with `robot: `, the program's key.
"""

from steptwin.host.common.bad_input import nearest, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import is_file
from steptwin.host.planning.programs.program import Program
from steptwin.host.robots import SUFFIX, load_robot, load_robot_file, robot_names
from steptwin.host.robots.robot import Robot


def load_own_robot(program: Program) -> Robot:
    """Return the robot that a program names; raise InputError if it names none, or one that is unknown or wrong."""
    if program.robot is None:
        raise InputError("robot: is missing: name it in the file, or behind it")
    if program.robot.endswith(SUFFIX):
        with prefixed("robot: "):
            return _load_file(program, program.robot)
    if program.robot not in robot_names():
        if _is_beside(program):
            raise InputError(f"robot: {program.robot!r} is unknown: {_beside_words(program)}")
        raise unknown("robot:", program.robot, robot_names())
    return load_robot(program.robot)


def check_own_robot(program: Program, robot: Robot) -> None:
    """Raise InputError unless a program and its file of positions are for a robot, or say nothing of it."""
    given = program.robot
    if given is not None and given != robot.name:
        if not given.endswith(SUFFIX):
            hint = f"; {_beside_words(program)}" if _is_beside(program) else ""
            raise InputError(f"robot: the program is for {given}, not for {robot.name}{hint}")
        own = load_own_robot(program)
        if own.name != robot.name:
            raise InputError(f"robot: the program is for {own.name} in {given}, not for {robot.name}")
    if program.positions_for not in (None, robot.name):
        raise InputError(f"positions_file: its positions are for {program.positions_for}, not for {robot.name}")


def _is_beside(program: Program) -> bool:
    return is_file(program.folder / f"{program.robot}{SUFFIX}")


def _beside_words(program: Program) -> str:
    return f"did you mean {program.robot}{SUFFIX}, the file beside it?"


def _load_file(program: Program, name: str) -> Robot:
    path = program.folder / name
    if not is_file(path):
        beside = [file.stem for file in path.parent.glob(f"*{SUFFIX}")] if path.parent.is_dir() else []
        near = [f"{name}{SUFFIX}" for name in nearest(path.stem, beside)]
        hint = f": did you mean {' or '.join(near)}?" if near else ", counted from the program's folder"
        raise InputError(f"{path}: there is no such file{hint}")
    return load_robot_file(str(path))
