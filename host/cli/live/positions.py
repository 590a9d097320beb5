"""`steptwin positions save|list|delete ...`: save positions of a live board by name, list and delete them."""

from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import PositionsFile, positions_path
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.options import argument, switch
from steptwin.host.cli.output import pose_text, print_table
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from steptwin.host.planning.programs.positions import Position
    from steptwin.host.robots.robot import Robot


_NAMED: Final = {"save": True, "list": False, "delete": True}
"""Actions of the command, and whether each takes a position's name."""


@command("save pick ar4-mk3 --connect 127.0.0.1", "list ar4-mk3 --file bench.toml")
def positions(
    live: SessionOptions,
    words: list[str] | None = argument(
        "ACTION [NAME] ROBOT", "save NAME, list or delete NAME; and the robot whose positions they are."
    ),
    file: PositionsFile = None,
    replace: bool = switch("Save in place of a position of the same name."),
) -> None:
    """Save under a name where a live board stands; list the saved positions, or delete one.

    `steptwin move ROBOT --to NAME` goes there. The file has the form of a program's [positions]. Only save needs a
    board.
    """
    action, name, rest = _split(words or [])
    robot, rest = live.robot_and_rest(rest)
    if rest:
        raise InputError(f"{rest[0]!r} is one word too many: {action}{' NAME' if _NAMED[action] else ''} ROBOT")
    path = positions_path(robot, file)
    if action == "save":
        _save(live, robot, path, name, replace=replace)
        return
    if replace or live.force or live.address.connection(robot):
        raise InputError(f"{action}: needs no board and takes no --replace; they are for save")
    if action == "list":
        _list(live, robot, path)
    else:
        _delete(live, robot, path, name)


def _split(words: list[str]) -> tuple[str, str, list[str]]:
    """Return the action, the position's name or an empty text, and the remaining words."""
    if not words:
        raise InputError(f"what? {', '.join(_NAMED)}")
    action, *rest = words
    if action not in _NAMED:
        raise unknown("action", action, _NAMED)
    if not _NAMED[action]:
        return action, "", rest
    if not rest:
        raise InputError(f"{action}: NAME is missing: {action} NAME ROBOT")
    return action, rest[0], rest[1:]


def _save(live: SessionOptions, robot: "Robot", path: str, name: str, *, replace: bool) -> None:
    from steptwin.host.planning.programs.positions import check_saving, find_position, read_positions, save_position

    check_saving(path, robot, name, replace=replace)
    with live.session(robot) as session:
        joints = session.look("positions save").joints
        pose = session.pose(joints)
        save_position(path, robot, name, joints, "" if pose is None else pose_text(pose), replace=replace)
        position = find_position(read_positions(path, robot), name, path)
    live.tell_of(robot, {"file": path, "name": name, **_document(position)}, f"{path}: {name} = {_words(position)}")


def _list(live: LiveOptions, robot: "Robot", path: str) -> None:
    from steptwin.host.planning.programs.positions import read_positions

    found = read_positions(path, robot)
    rows = [[name, _words(position)] for name, position in found.items()]
    live.tell_of(
        robot,
        {"file": path, "positions": {name: _document(position) for name, position in found.items()}},
        lambda: print_table(["name", "position"], rows, text_columns=2),
    )


def _delete(live: LiveOptions, robot: "Robot", path: str, name: str) -> None:
    from steptwin.host.planning.programs.positions import delete_position

    delete_position(path, robot, name)
    live.tell_of(robot, {"file": path, "deleted": name}, f"{path}: {name} deleted")


def _document(position: "Position") -> dict[str, Any]:
    from steptwin.host.planning.programs.positions import JointPosition

    if isinstance(position, JointPosition):
        return {"joints": dict(position.joints)}
    turned = {position.orientation.key: list(position.orientation.values)} if position.orientation else {}
    return {"tool": {**position.coordinates, **turned}, "branch": position.branch}


def _words(position: "Position") -> str:
    from steptwin.host.planning.programs.positions import JointPosition

    if isinstance(position, JointPosition):
        return _numbers(position.joints)
    return f"tool: {_numbers(position.coordinates)}" + (f" ({position.branch})" if position.branch else "")


def _numbers(values: "Mapping[str, float]") -> str:
    return ", ".join(f"{name} {value:.10g}" for name, value in values.items())
