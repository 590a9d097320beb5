"""Saved positions: go there, save where the machine stands, delete one; the file is that of `steptwin positions`."""

from collections.abc import Callable, Mapping
from pathlib import Path

from nicegui import ui

from steptwin.host.common.errors import InputError
from steptwin.host.panel.desk import MoveJoints, MoveTool
from steptwin.host.panel.page.elements import cell, line, note, plain, table
from steptwin.host.panel.page.scene import ArmScene, links_at
from steptwin.host.panel.page.visitor import Visitor
from steptwin.host.planning.programs.position_file import delete_position, read_positions, save_position
from steptwin.host.planning.programs.positions import JointPosition, Position


class SavedPositions:
    """A row for each position in the file."""

    def __init__(self, visitor: Visitor, scene: ArmScene, path: str, percent: Callable[[], float]) -> None:
        self._visitor, self._scene, self._path, self._percent = visitor, scene, path, percent
        with ui.element("div").classes("stack") as self.root:
            with line():
                self._name = ui.input("name").props("outlined dense").classes("w-field")
                plain("Save where it stands", self._save, "bookmark_add")
            self._list = ui.element("div")
            note(f"The positions are in the file {path}, which commands and programs use, too.")
        self.show()

    def show(self) -> None:
        """Read the file and show it."""
        self._list.clear()
        positions: Mapping[str, Position] = {}
        with self._visitor.explained():
            if Path(self._path).exists():
                positions = read_positions(self._path, self._visitor.desk.robot)
        with self._list:
            if not positions:
                note("No position is saved yet.")
                return
            with table([("name", ""), ("position", ""), ("", "")]):
                for name, position in positions.items():
                    self._row(name, position)

    def _row(self, name: str, position: Position) -> None:
        with ui.element("tr"):
            with cell():
                ui.label(name).classes("joint-name")
            with cell("muted small"):
                ui.label(position_words(position))
            with cell(), line("tight nowrap"):
                go = plain("Go", lambda: self._go(position))
                go.props["aria-label"] = f"go to {name}"
                go.on("mouseenter", lambda: self._show_ghost(position))
                go.on("mouseleave", lambda: self._scene.clear_shape("ghost"))
                plain("Delete", lambda: self._delete(name)).props["aria-label"] = f"delete {name}"

    def _show_ghost(self, position: Position) -> None:
        joints = self._visitor.desk.snapshot.joints
        if isinstance(position, JointPosition) and joints:
            goal = [position.joints.get(joint.name, joint.position) for joint in joints]
            self._scene.show_arm("ghost", links_at(self._visitor.desk.robot, goal))

    def _go(self, position: Position) -> None:
        percent = self._percent()
        if isinstance(position, JointPosition):
            self._visitor.ask(MoveJoints(joints=position.joints, speed_percent=percent))
        else:
            self._visitor.ask(MoveTool(position=position, speed_percent=percent))

    def _save(self) -> None:
        name = str(self._name.value or "").strip()
        snapshot = self._visitor.desk.snapshot
        with self._visitor.explained() as failed:
            if not snapshot.connected:
                raise InputError("nothing to save: the machine is not connected")
            if not snapshot.homed:
                raise InputError("nothing to save: not every joint is homed")
            if Path(self._path).exists() and name in read_positions(self._path, self._visitor.desk.robot):
                raise InputError(f"{name} is saved already: delete it first")
            joints = [joint.position for joint in snapshot.joints]
            save_position(self._path, self._visitor.desk.robot, name, joints, "", replace=False)
        if not failed:
            self._name.set_value("")
            self._visitor.tell(f"{name} is saved", good=True)
        self.show()

    def _delete(self, name: str) -> None:
        self._visitor.attempt(lambda: delete_position(self._path, self._visitor.desk.robot, name))
        self.show()


def position_words(position: Position) -> str:
    """Return a position in one line."""
    values = position.joints if isinstance(position, JointPosition) else position.coordinates
    words = ", ".join(f"{name} {value:.6g}" for name, value in values.items())
    if isinstance(position, JointPosition):
        return words
    return f"tool: {words}" + (f" ({position.branch})" if position.branch else "")
