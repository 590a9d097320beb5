"""The Move tab: go to joint positions, to a pose of the tool on a chosen branch, or to a saved position."""

from collections.abc import Callable, Mapping
from functools import partial
from math import nan
from pathlib import Path
from typing import Final

import numpy as np
from nicegui import ui

from steptwin.features.panel.page.elements import (
    Form,
    FormField,
    act,
    cell,
    choice,
    heading,
    line,
    make_input,
    note,
    plain,
    stack,
    table,
    titled,
    wrong,
)
from steptwin.features.panel.page.scene import ArmScene, links_at
from steptwin.features.panel.page.visitor import Visitor
from steptwin.features.panel.service.commands import Command, DeclareHere, MoveJoints, MoveTool
from steptwin.features.panel.service.messages import DECLARE_POSITION
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs.options import OptionRange
from steptwin.host.planning.programs.positions import (
    JointPosition,
    Position,
    ToolPosition,
    delete_position,
    read_positions,
    save_position,
)
from steptwin.host.robots.kinematics import Branch, make_kinematics
from steptwin.host.robots.poses import COLUMNS, PLACE, POSE, Orientation, Pose

_KINDS: Final = {"joints": "Joints", "tool": "Tool pose", "saved": "Saved positions"}
Go = Callable[[Callable[[float], Command]], None]
"""Requests a move; the function it gets makes the command for a percentage of the highest speeds."""


class MoveTab:
    """Three kinds of targets, and one speed."""

    def __init__(self, visitor: Visitor, scene: ArmScene, positions_file: str) -> None:
        self._visitor, self._scene = visitor, scene
        with line("between"):
            has_tool = make_kinematics(visitor.service.robot).task.width > 0
            kinds = {name: title for name, title in _KINDS.items() if has_tool or name != "tool"}
            choice("kind of move", kinds, "joints", self._choose)
            speed = FormField("speed", "speed", 30.0, OptionRange(1.0, 100.0, "%"))
            self._speed = make_input(speed).classes("w-narrow")
        self._joints = _JointsForm(visitor, scene, self._go)
        self._tool = _ToolForm(visitor, scene, self._go)
        saved = _SavedPositions(visitor, scene, positions_file, self._go)
        self._forms = {"joints": self._joints.root, "tool": self._tool.root, "saved": saved.root}
        self._choose("joints")

    def refresh(self, snapshot: Snapshot) -> None:
        for form in (self._joints, self._tool):
            form.fill_once(snapshot)
            form.button.set_enabled(snapshot.activity is None)

    def _go(self, command: Callable[[float], Command]) -> None:
        no_speed = wrong([self._speed])
        if no_speed is not None:
            self._visitor.tell(no_speed)
        elif self._visitor.ask(command(float(self._speed.value))):
            self._scene.clear_shape("ghost")

    def _choose(self, name: str) -> None:
        for kind, form in self._forms.items():
            form.set_visibility(kind == name)
        self._scene.clear_shape("ghost")


class _SavedPositions:
    """A row for each position in the file."""

    def __init__(self, visitor: Visitor, scene: ArmScene, path: str, go: Go) -> None:
        self._visitor, self._scene, self._path, self._go = visitor, scene, path, go
        self.root: ui.element = stack()
        with self.root:
            with line():
                self._name = ui.input("name").props("outlined dense").classes("w-field")
                plain("Save present position", self._save, "bookmark_add")
            self._list = ui.element("div")
            note(f"The positions are in the file {path}, which commands and programs use, too.")
        self._show()

    def _show(self) -> None:
        self._list.clear()
        positions: Mapping[str, Position] = {}
        with self._visitor.explained():
            if Path(self._path).exists():
                positions = read_positions(self._path, self._visitor.service.robot)
        with self._list:
            if not positions:
                note("No position is saved yet.")
                return
            with table("name", "position", ""):
                for name, position in positions.items():
                    self._row(name, position)

    def _row(self, name: str, position: Position) -> None:
        def command(speed_percent: float) -> Command:
            if isinstance(position, JointPosition):
                return MoveJoints(joints=position.joints, speed_percent=speed_percent)
            return MoveTool(position=position, speed_percent=speed_percent)

        with ui.element("tr"):
            cell(name)
            cell(_position_words(position), "muted small")
            with cell(), line("tight nowrap"):
                go = plain("Go", lambda: self._go(command), label=f"go to {name}", moves=True)
                go.on("mouseenter", lambda: self._show_ghost(position))
                go.on("mouseleave", lambda: self._scene.clear_shape("ghost"))
                plain("Delete", lambda: self._delete(name), label=f"delete {name}")

    def _show_ghost(self, position: Position) -> None:
        joints = self._visitor.service.snapshot.joints
        if isinstance(position, JointPosition) and joints:
            goal = [position.joints.get(joint.name, joint.position) for joint in joints]
            self._scene.show_arm("ghost", links_at(self._visitor.service.robot, goal))

    def _save(self) -> None:
        name, robot = str(self._name.value or "").strip(), self._visitor.service.robot
        snapshot = self._visitor.service.snapshot
        with self._visitor.explained() as failed:
            if not snapshot.connected:
                raise InputError("nothing to save: the machine is not connected")
            if not snapshot.homed:
                raise InputError("nothing to save: not every joint is homed")
            if Path(self._path).exists() and name in read_positions(self._path, robot):
                raise InputError(f"{name} is saved already: delete it first")
            joints = [joint.position for joint in snapshot.joints]
            save_position(self._path, robot, name, joints, "", replace=False)
        if not failed:
            self._name.set_value("")
            self._visitor.tell(f"{name} is saved", "good")
        self._show()

    def _delete(self, name: str) -> None:
        self._visitor.attempt(lambda: delete_position(self._path, self._visitor.service.robot, name))
        self._show()


def _position_words(position: Position) -> str:
    if isinstance(position, JointPosition):
        return ", ".join(f"{name} {value:.6g}" for name, value in position.joints.items())
    return f"tool: {position.words}" + (f" ({position.branch})" if position.branch else "")


class _JointsForm:
    """A field for each joint."""

    def __init__(self, visitor: Visitor, scene: ArmScene, go: Go) -> None:
        self._visitor, self._scene, self._go = visitor, scene, go
        self._filled = self._known = False
        robot = visitor.service.robot
        self._kinematics = make_kinematics(robot)
        self.root: ui.element = stack()
        with self.root:
            ranges = {joint.name: OptionRange(joint.lower, joint.upper, str(joint.unit)) for joint in robot.joints}
            fields = (FormField(name, name, None, allowed) for name, allowed in ranges.items())
            self._form = Form(fields, self._show_ghost)
            self._tool = note("")
            with line():
                self.button: ui.button = act("Move", self._move, "arrow_forward", moves=True)
                plain(DECLARE_POSITION, self._declare, "push_pin", moves=True).tooltip(
                    "For joints without a switch: nothing moves, the machine takes these for its positions."
                )
                plain("Fill in present position", self._fill)
                home = dict(zip(robot.joint_names, robot.home, strict=True))
                plain("Home position", lambda: self._form.fill(home))

    def fill_once(self, snapshot: Snapshot) -> None:
        """Fill in the position once it is known: with the first snapshot, and after homing."""
        known = snapshot.homed and snapshot.activity is None
        if snapshot.joints and (not self._filled or (known and not self._known)):
            self._fill()
        self._known = known or (self._known and snapshot.homed)

    def _fill(self) -> None:
        """Fill in the machine's position; a joint with an unknown position stays empty."""
        joints = self._visitor.service.snapshot.joints
        self._filled = bool(joints)
        self._form.fill({joint.name: round(joint.position, 3) if joint.homed else None for joint in joints})
        self._scene.clear_shape("ghost")

    def _goal(self) -> dict[str, float] | None:
        return self._form.values() if self._form.wrong() is None else None

    def _show_ghost(self) -> None:
        goal = self._goal()
        self._tool.set_text("" if goal is None else self._tool_words(goal))
        if goal is None:
            self._scene.clear_shape("ghost")
        else:
            self._scene.show_arm("ghost", links_at(self._visitor.service.robot, list(goal.values())))

    def _tool_words(self, goal: Mapping[str, float]) -> str:
        task = self._kinematics.task
        figures = task.figures(self._kinematics.forward(np.array([list(goal.values())])))[0]
        if not np.isfinite(figures).all():
            return "The mechanism cannot be assembled there."
        placed = zip(task.coordinates.items(), figures.round(3).tolist(), strict=True)
        return "Tool there: " + ", ".join(f"{name} {value:z.3f} {unit}" for (name, unit), value in placed)

    def _declare(self) -> None:
        goal = self._goal()
        if goal is None:
            self._visitor.tell(self._form.wrong() or "")
        else:
            self._visitor.ask(DeclareHere(joints=tuple(goal.values())))

    def _move(self) -> None:
        goal = self._goal()
        if goal is not None:
            self._go(lambda percent: MoveJoints(joints=goal, speed_percent=percent))
            return
        homed = self._visitor.service.snapshot.homed
        unknown = "where the joints are is unknown: home the machine first"
        self._visitor.tell((self._form.wrong() if homed else None) or unknown)


_KEYS: Final = {
    "rpy_deg": "roll, pitch, yaw",
    "quaternion_xyzw": "quaternion",
    "rotvec_deg": "rotation vector",
    "abc_deg": "A, B, C",
}
"""Notations of the orientation of a tool that turns in space."""
_IDENTITY: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_FAR_MM: Final = 1e5
"""Largest coordinate in a field; the kinematics check the reach."""


class _ToolForm:
    """Fields for the tool's pose, and every branch that reaches it, or why none does."""

    def __init__(self, visitor: Visitor, scene: ArmScene, go: Go) -> None:
        self._visitor, self._scene, self._go = visitor, scene, go
        self._kinematics = make_kinematics(visitor.service.robot)
        self._task = self._kinematics.task
        self._filled = False
        self._branch: str | None = None
        self._key = "rpy_deg" if self._task is POSE else None
        self.root: ui.element = stack()
        with self.root:
            if self._key is not None:
                with titled("Orientation as"):
                    choice("how the orientation is written", _KEYS, self._key, self._write_as)
            self._place = ui.element("div")
            self._form = self._make_form()
            if self._kinematics.attitude_follows:
                note("The tool's attitude follows from the arm.")
            heading("Ways to get there")
            self._branches = ui.element("div").classes("stack tight").props('role=radiogroup aria-label="branches"')
            with line():
                self.button: ui.button = act("Move", self._move, "arrow_forward", moves=True)
                plain("Fill in present position", self._fill)

    def _make_form(self) -> Form:
        coordinates = dict(self._task.coordinates if self._key is None else {**PLACE, **COLUMNS[self._key]})
        if self._kinematics.attitude_follows:
            coordinates.pop("phi", None)
        allowed = {name: OptionRange(-_FAR_MM, _FAR_MM, unit) for name, unit in coordinates.items()}
        self._place.clear()
        with self._place:
            fields = (FormField(name, name, None, each, hint=False) for name, each in allowed.items())
            return Form(fields, self._look_for_branches)

    def _write_as(self, key: str) -> None:
        """Change the notation of the orientation; convert the pose if the fields have one."""
        pose = self._pose()
        self._key = key
        self._form = self._make_form()
        if isinstance(pose, tuple):
            self._show(pose)

    def fill_once(self, snapshot: Snapshot) -> None:
        """Fill in the tool's pose once, when it is known and the machine is idle."""
        if not self._filled and snapshot.pose is not None and snapshot.activity is None:
            self._fill()

    def _fill(self) -> None:
        """Fill in the tool's pose; empty if it is unknown or the machine has no tool."""
        pose = self._visitor.service.snapshot.pose
        if not pose:
            return
        self._filled = True
        self._show(tuple(self._task.of_figures(np.array([list(pose.values())]))[0].tolist()))
        self._look_for_branches()
        self._scene.clear_shape("ghost")

    def _show(self, pose: Pose) -> None:
        if self._key is None:
            numbers = self._task.figures(np.array(pose)).tolist()
            names = list(self._task.coordinates)
        else:
            numbers = [*pose[:3], *Orientation.of(self._key, np.array(pose[3:])).values]
            names = [*PLACE, *COLUMNS[self._key]]
        decimals = 6 if self._key == "quaternion_xyzw" else 3
        self._form.fill({name: round(number, decimals) for name, number in zip(names, numbers, strict=True)})

    def _given(self) -> tuple[dict[str, float], Orientation | None]:
        """Return coordinates and orientation from the filled fields; raise InputError for an invalid orientation."""
        values = {name: float(value) for name, value in self._form.values().items()}
        if self._key is None:
            return self._task.told(values)
        orientation = Orientation(self._key, tuple(values[name] for name in COLUMNS[self._key]))
        return {name: values[name] for name in PLACE}, orientation

    def _pose(self) -> Pose | str | None:
        """Return the pose in the fields; None if a field is empty, and a message if it is invalid."""
        values = self._form.values()
        if None in values.values():
            return None
        if self._key is None:  # a dependent attitude has no field
            figures = [values.get(name, nan) for name in self._task.coordinates]
            return tuple(self._task.of_figures(np.array([figures]))[0].tolist())
        try:
            return self._task.changed(_IDENTITY, *self._given())
        except InputError as error:
            return str(error)

    def _look_for_branches(self) -> None:
        self._branches.clear()
        self._scene.clear_shape("ghost")
        pose, service = self._pose(), self._visitor.service
        branches: tuple[Branch, ...] = ()
        if isinstance(pose, tuple):
            now = [joint.position for joint in service.snapshot.joints] or list(service.robot.home)
            branches = self._kinematics.inverse(np.array([pose]), np.array(now))
        names = [branch.name for branch in branches if branch.reachable[0]]
        if self._branch not in names:
            self._branch = names[0] if names else None
        with self._branches:
            if isinstance(pose, str):
                note(pose, "bad")
            for branch in branches:
                self._branch_row(branch)

    def _branch_row(self, branch: Branch) -> None:
        reason, robot = branch.reason(0), self._visitor.service.robot
        chosen = reason is None and branch.name == self._branch
        with ui.element("div").classes("branch" if reason is None else "branch off") as row:
            mark = ui.icon("radio_button_checked" if chosen else "radio_button_unchecked")
            mark.props('aria-hidden="true"')
            ui.label(branch.name)
            if reason is None:
                values = (branch.joints[0].round(2) + 0.0).tolist()  # -0.0 is written 0
                parts = zip(robot.joints, values, strict=True)
                ui.label("  ".join(f"{joint.name} {value:.2f}" for joint, value in parts)).classes("muted small")
            else:
                ui.label(reason).classes("small")
        row.props(f"role=radio aria-checked={'true' if chosen else 'false'}")
        if reason is None:
            choose = partial(self._choose, branch.name)
            row.props("tabindex=0").on("click", choose).on("keydown.space.prevent", choose)
        else:
            row.props('aria-disabled="true"')
        if chosen:
            self._scene.show_arm("ghost", links_at(robot, branch.joints[0].tolist()))

    def _choose(self, name: str) -> None:
        self._branch = name
        self._look_for_branches()

    def _move(self) -> None:
        if self._branch is None:
            self._visitor.tell(self._form.wrong() or "no way to get there: change the pose")
            return
        coordinates, orientation = self._given()
        position = ToolPosition(coordinates, self._branch, orientation)
        self._go(lambda percent: MoveTool(position=position, speed_percent=percent))
