"""Moves of a program under construction: positions are converted to joints and poses, paths to motions."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from math import ceil, nan
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.laws import Law, SCurve, time_at
from steptwin.host.planning.motion import OutputChange
from steptwin.host.planning.motions.composer import JERK_TIME_S, Composer
from steptwin.host.planning.motions.joint_move import limits_along
from steptwin.host.planning.motions.tool_move import (
    branches_on,
    is_straight_in_joints,
    nearest_turns,
    present_branch,
    tool_move,
)
from steptwin.host.planning.motions.whole import FlowingSteps, motion_timer
from steptwin.host.planning.no_way import NO_WAY, is_no_way
from steptwin.host.planning.paths import (
    Arc,
    OnTheSpot,
    Oriented,
    OutOfReachError,
    Smoothing,
    ToolPath,
    Turn,
    curve_through,
    straight,
)
from steptwin.host.planning.peaks import highest, sampled, speed_peaks
from steptwin.host.planning.programs.flow import LegTime, check_none_gathered, switch_on_way
from steptwin.host.planning.programs.paces import SPEED_PERCENT, JointPace, StepPace, ToolPace
from steptwin.host.planning.programs.pallets import STATION_FRAME, Cells, Pallet
from steptwin.host.planning.programs.positions import Beside, JointPosition, Position, Target, ToolPosition
from steptwin.host.robots.kinematics import Branch, make_kinematics
from steptwin.host.robots.poses import PLACE, POSITION, SCARA, Pose, Turning
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.nearest_pose import passing_text


def turning_law(robot: Robot, turn: Turn, branch: str, start: FloatArray, goal: FloatArray, percent: float) -> Law:
    """Return the jerk-limited law of the angle, within a percentage of the joints' limits of speed and acceleration.

    The joints do not turn in proportion to the angle. So the law for the joints' whole travel, from `start` to `goal`,
    is tried, and stretched by the excess of its peaks.
    """
    whole = limits_along(robot, goal - start)
    speed, acceleration = (turn.length_mm * limit * percent / 100 for limit in whole)

    def law(stretch: float) -> SCurve:
        slower = acceleration / stretch**2
        return SCurve.fastest(turn.length_mm, speed / stretch, slower, slower / (stretch * JERK_TIME_S))

    tried = tool_move(robot, turn, law(1.0), branch, start)
    peaks = highest(speed_peaks(robot, samples) for samples in sampled(tried))
    return law(max(replace(peak, limit=peak.limit * percent / 100).stretch for peak in peaks))


_HALF_TURN_DEG: Final = 180.0


def _turn_deg(path: ToolPath) -> float:
    """Return the angle by which the tool turns in space on a path; 0 for SCARAs, which only joint limits restrict."""
    return path.turning.angle_deg if isinstance(path, Oriented) else 0.0


def check_steps(robot: Robot, distances: Mapping[str, float]) -> None:
    """Raise InputError if the robot's tool cannot be moved by distances and angles with these names."""
    kinematics = make_kinematics(robot)
    if "phi" in distances and kinematics.attitude_follows:
        raise InputError(f"phi: the tool of {robot.name} does not turn by itself")
    kinematics.task.check_steps(distances)


class Moves:
    """Moves from a robot's position on, with the program's named positions; `composer` has the motions so far."""

    def __init__(
        self,
        robot: Robot,
        positions: Mapping[str, Position],
        joints: FloatArray | None = None,
        pallets: Mapping[str, Pallet] | None = None,
        drives: DriveLimits | None = None,
    ) -> None:
        """Start at joints of shape (joints,), or at the robot's home position."""
        self._robot = robot
        self._positions = positions
        self._pallets = pallets or {}
        self._drives = drives
        self.cells: Cells = {}
        """Present cell of each pallet in use."""
        self._kinematics = make_kinematics(robot)
        self._task = self._kinematics.task
        self.composer: Composer = Composer(robot, np.array(robot.home) if joints is None else joints)
        self.place = ""
        """Step that is being added, as text for messages."""
        self.legs: FlowingSteps | None = None
        """Blended steps that have not ended yet."""
        self.switched: tuple[OutputChange, ...] = ()
        """Outputs that change on the path of the last step without blending."""
        self.notes: tuple[str, ...] = ()
        """Further notes about the last step."""
        self.leg_times: list[LegTime] = []
        """Times of the blended steps up to the last one that ended."""

    def from_here(self) -> "Moves":
        """Return new moves that start at the present position."""
        moves = Moves(self._robot, self._positions, self.composer.joints, self._pallets, self._drives)
        moves.cells = self.cells
        return moves

    # --- positions

    def joints_at(self, target: Target) -> FloatArray:
        """Return the joints of a position, of shape (joints,); raise InputError if the robot cannot reach it."""
        position = self._position(target)
        if isinstance(position, JointPosition):
            joints = self.composer.joints.copy()
            for name, value in position.joints.items():
                joints[self._robot.index_of(name)] = value
            return joints
        return self._solve(self._with(position), position.branch)

    def joints_by(self, distances: Mapping[str, float]) -> FloatArray:
        """Return the joints after a relative move of some joints, of shape (joints,)."""
        joints = self.composer.joints.copy()
        for name, distance in distances.items():
            joints[self._robot.index_of(name)] += distance
        return joints

    def joints_of(self, pose: Pose) -> FloatArray:
        """Return the joints at a pose on the present branch, of shape (joints,); raise InputError without any."""
        return self._solve(self._wanted(pose), None)

    def says_everything(self, target: Target) -> bool:
        """Return whether a position defines all joints or coordinates; the branch may be open."""
        match self._found(target):
            case None:
                return False
            case JointPosition(joints):
                return set(joints) == set(self._robot.joint_names)
            case ToolPosition(coordinates, orientation=orientation):
                if orientation is not None or self._task is POSITION:
                    return coordinates.keys() >= {"x", "y", "z"}
                left_out = set(SCARA.coordinates) - set(coordinates)
                return not left_out or (self._kinematics.attitude_follows and left_out == {"phi"})

    def says_branch(self, target: Target) -> bool:
        """Return whether a position defines the branch, wherever the robot is."""
        match self._found(target):
            case None:
                return False
            case JointPosition():
                return True
            case ToolPosition(branch=branch):
                return branch is not None or len(self._kinematics.branches) == 1

    def check_some_branch(self, target: Target) -> None:
        """Raise InputError if no branch reaches a position that defines all but its branch."""
        position = self._position(target)
        if isinstance(position, ToolPosition):
            unknown_pose = (nan,) * self._task.width
            pose = self._task.changed(unknown_pose, position.coordinates, position.orientation)
            if not any(found.reachable[0] for found in self._branches(pose)):
                self._solve(pose, None)

    def pose_at(self, target: Target) -> Pose:
        """Return the tool's pose at a position, with the attitude's turn nearest to the present one."""
        position = self._position(target)
        if isinstance(position, JointPosition):
            return self._nearest_turn(self._pose(self.joints_at(position)))
        return self._nearest_turn(self._with(position))

    def pose_by(self, distances: Mapping[str, float]) -> Pose:
        """Return the tool's pose after a relative move; phi may turn it further than a circle."""
        check_steps(self._robot, distances)
        return self._task.stepped(self._here(), distances)

    # --- motions

    def go(self, goal: FloatArray, pace: JointPace) -> None:
        """Move all joints to a position of shape (joints,); do nothing if they are there."""
        way = goal - self.composer.joints
        if is_no_way(way):
            self._gathered(pace)
        elif self._flows(pace):
            self._gather_joints(goal, pace)
        else:
            self.composer.go_by(pace.along(self._robot, way), goal)

    def line(self, goal: Pose, pace: ToolPace) -> None:
        """Move the tool straight to a pose; if only the attitude differs, turn it on the spot, at SPEED_PERCENT."""
        here = self._here()
        if not is_no_way(np.subtract(goal, here)[:3]):
            self._straight(straight(self._task, here, goal), goal, pace)
        elif self._task is not SCARA:
            self._turn_in_space(here, goal, pace)
        elif abs(goal[3] - here[3]) > _HALF_TURN_DEG + NO_WAY:
            steps = ceil(abs(goal[3] - here[3]) / _HALF_TURN_DEG)
            raise InputError(
                f"phi: {goal[3] - here[3]:g} deg on the spot is more than half a turn: make {steps} steps of it"
            )
        elif abs(goal[3] - here[3]) > NO_WAY:
            self._turn(Turn(here, goal[3] - here[3]), pace)
        else:
            self._stay(pace)

    def arc(self, via: Pose, goal: Pose, pace: ToolPace) -> None:
        """Move the tool along the arc through a pose's place to a pose."""
        here, (x_mm, y_mm, z_mm, *_) = self._here(), via
        if self._task.is_flat:
            self._follow(Arc.through(here, (x_mm, y_mm, z_mm), goal), pace, goal)
        else:
            arc = Arc.through(here[:3], (x_mm, y_mm, z_mm), goal[:3])
            self._follow(Oriented(arc, Turning.shortest(self._task, here, goal)), pace, goal)

    def circle(self, x_mm: float, y_mm: float, sweep_deg: float, pace: ToolPace, *, turned: bool) -> None:
        """Move the tool around the vertical axis at x, y, at its height; `turned` turns the tool along."""
        here, task = self._here(), self._task
        arc = Arc.around(here if task.is_flat else here[:3], (x_mm, y_mm), sweep_deg, turned=turned)
        turn_deg = np.array([0.0, 0.0, sweep_deg if turned else 0.0])
        self._follow(arc if task.is_flat else Oriented(arc, Turning(task, np.array(here[3:]), turn_deg)), pace)

    def through(self, poses: list[Pose], smoothing: Smoothing, pace: ToolPace) -> None:
        """Move the tool along the curve from its position through poses; each turn continues from the last one."""
        rows = np.array([self._here(), *poses])
        self._follow(curve_through(self._task, rows, smoothing), pace, *poses)

    def _follow(self, path: ToolPath, pace: ToolPace, *goals: Pose) -> None:
        """Move along a path; refuse a goal out of reach before a place on the path."""
        if not path.length_mm > NO_WAY:
            raise InputError(f"the path of the tool is {path.length_mm:.3g} mm long: that is no way")
        for goal in goals:
            self._check_goal(goal, path)
        self._move_along(path, pace, pace.along(path.length_mm, _turn_deg(path)))

    def _check_goal(self, goal: Pose, path: ToolPath) -> None:
        """Raise InputError for a goal of a path that is out of reach on all branches along the path."""
        wanted, own = self._wanted(goal), self._branch()
        try:
            self._solve(wanted, own, on_path=True)
        except InputError:
            if self._kinematics.keeps_branch:
                raise
            names, _ = branches_on(self._robot, path, own, self.composer.joints)
            reached = {found.name for found in self._branches(wanted) if found.reachable[0]}
            if not reached.intersection(names):
                raise

    def _straight(self, line: ToolPath, end: Pose, pace: ToolPace) -> None:
        try:
            self._follow(line, pace, end)
        except OutOfReachError:  # at a singularity the joints may still move the tool straight, as with a lift alone
            goal = self._straight_in_joints(line, end)
            if goal is None:
                raise
            if self._flows(pace):
                self._gather_joints(goal, pace)
            else:
                self.composer.go_by(pace.share(line.length_mm, _turn_deg(line)), goal)

    def end_flow(self) -> None:
        """Bring blended steps to rest, if there are any, and store their times in `leg_times`.

        Raises CornerError for a corner that cannot be rounded; the position is then the end, without a motion.
        """
        legs, end = self.legs, self.composer.joints
        self.legs = None
        if legs:
            try:
                self.composer.joints = legs.start
                self.leg_times = legs.make(self.composer)
            except InputError:
                self.composer.joints = end
                raise

    def forget_flow(self) -> None:
        """Drop blended steps: the next one begins at the present position."""
        self.legs = None

    def _flows(self, pace: StepPace) -> bool:
        """Return whether a step is blended, or has the law of blended motions."""
        return pace.is_whole or (self.legs is not None and self.legs.is_open)

    def _gathering(self) -> FlowingSteps:
        """Return the blended steps, new ones at the present position if there are none."""
        if not self.legs:
            self.legs = motion_timer().flow(self._robot, self.composer.joints, self._drives)
        return self.legs

    def _gather_joints(self, goal: FloatArray, pace: StepPace) -> None:
        self.composer.joints = self._gathering().add_joints(self.composer.joints, goal, pace)
        self._gathered(pace)

    def _move_along(self, path: ToolPath, pace: ToolPace, law: Law) -> None:
        """Move the tool along a path, by its own law unless it is blended."""
        branch = self._branch()
        if self._flows(pace):
            self.composer.joints = self._gathering().add_path(self.composer.joints, path, branch, pace)
            self._gathered(pace)
        else:
            begins_s = self.composer.now_s
            times_s = [time_at(law, each.place_mm(path.length_mm)) for each in pace.outputs]
            self.composer.follow(path, law, branch)
            self.switched = switch_on_way(self.composer, pace.outputs, times_s, begins_s)

    def _gathered(self, pace: StepPace) -> None:
        if pace.blend_mm is None:
            self.end_flow()

    def _stay(self, pace: ToolPace) -> None:
        """Make no motion, since the tool is there; raise InputError for outputs on the path."""
        for each in pace.outputs:
            raise InputError(
                f"outputs.{each.output}: the tool is there already, so it has no way on which an output could change:"
                " use a step `output`"
            )
        self._gathered(pace)

    def _begin_turn(self, pace: ToolPace) -> None:
        """Raise InputError for a blend between a turn on the spot and another step."""
        check_none_gathered(self.legs, "a turn on the spot")
        if pace.blend_mm is not None:
            raise InputError("blend_mm: a turn on the spot has no way to round; leave it out")

    def _straight_in_joints(self, line: ToolPath, end: Pose) -> FloatArray | None:
        """Return the joints at a line's end if a joint move keeps the tool on the line."""
        with suppress(InputError):
            goal = self._solve(self._wanted(end), self._branch())
            if is_straight_in_joints(self._robot, line, self.composer.joints, goal):
                return goal
        return None

    def _wanted(self, goal: Pose) -> Pose:
        """Return a path's goal without an attitude that depends on the arm."""
        return (*goal[:3], nan) if self._kinematics.attitude_follows else goal

    def _turn_in_space(self, here: Pose, goal: Pose, pace: ToolPace) -> None:
        """Turn the tool on the spot by the shortest rotation, if any, at the pace's speed."""
        if self._task.is_flat:
            self._stay(pace)
            return
        turning = Turning.shortest(self._task, here, goal)
        if turning.angle_deg <= NO_WAY:
            self._stay(pace)
        else:
            self._begin_turn(pace)
            path = Oriented(OnTheSpot(here[:3], turning.angle_deg), turning)
            self._check_goal(goal, path)
            self._move_along(path, pace, pace.turning(turning.angle_deg))

    def _turn(self, turn: Turn, pace: ToolPace) -> None:
        self._begin_turn(pace)
        branch, start = self._branch(), self.composer.joints
        goal = self._solve((*turn.start[:3], turn.start[3] + turn.angle_deg), branch)
        if is_straight_in_joints(self._robot, turn, start, goal):  # a wrist alone, also at a singularity
            self.go(goal, JointPace(law=pace.law))
        else:
            self._move_along(turn, pace, turning_law(self._robot, turn, branch, start, goal, SPEED_PERCENT))

    # --- the robot

    def _position(self, target: Target) -> Position:
        if isinstance(target, Beside):
            return self._beside(target)
        if not isinstance(target, str):
            return target
        if target not in self._positions:
            raise unknown("position", target, self._positions)
        return self._positions[target]

    def _found(self, target: Target) -> Position | None:
        """Return a position; None if it does not exist."""
        with suppress(InputError):
            return self._position(target)
        return None

    def _beside(self, target: Beside) -> ToolPosition:
        """Return a position beside a named one or beside the present cell, along the axes of the cell's frame."""
        if target.cell:
            pallet, number = self._pallets[target.cell], self.cells.get(target.cell)
            if number is None:
                each = f'each = "{target.cell}"'
                raise InputError(f"cell: {target.cell!r} has no present cell: put the step into `{each}`")
            base: Position = pallet.cells[number]
            frame = pallet.frame
        else:
            base, frame = self._position(target.at), STATION_FRAME
        if isinstance(base, JointPosition):
            raise InputError(f"at: {target.at!r} is a position of the joints; an offset is beside one of the tool")
        way_mm = frame.turned(np.array([target.offset.get(name, 0.0) for name in PLACE]))
        moved = dict(zip(PLACE, way_mm.tolist(), strict=True)) | {"phi": target.offset.get("phi", 0.0)}
        here = self._task.figures(np.array(self._here())).tolist()
        now = dict(zip(self._task.coordinates, here, strict=True))
        changed = {name: base.coordinates.get(name, now.get(name, 0.0)) + way for name, way in moved.items() if way}
        return ToolPosition({**base.coordinates, **changed}, base.branch, base.orientation)

    def _pose(self, joints: FloatArray) -> Pose:
        if not self._task.width:
            raise InputError(f"{self._robot.name} has no tool to lead: `go` and `by` move its joints")
        return tuple(self._kinematics.forward(joints[np.newaxis])[0].tolist())

    def _here(self) -> Pose:
        return self._pose(self.composer.joints)

    def _with(self, position: ToolPosition) -> Pose:
        """Return the present pose with some coordinates changed; a dependent attitude follows the arm."""
        pose = self._task.changed(self._here(), position.coordinates, position.orientation)
        if not self._kinematics.attitude_follows:
            return pose
        phi_deg = position.coordinates.get("phi", nan)
        return self._pose(self._solve((*pose[:3], phi_deg), position.branch))

    def _nearest_turn(self, pose: Pose) -> Pose:
        """Return a pose with phi in the turn nearest to the present one."""
        if self._task is not SCARA:
            return pose
        now_deg = self._here()[3]
        return *pose[:3], pose[3] + 360.0 * round((now_deg - pose[3]) / 360.0)

    def _branches(self, pose: Pose) -> tuple[Branch, ...]:
        return self._kinematics.inverse(np.array([pose]), self.composer.joints)

    def _solve(self, pose: Pose, branch: str | None, *, on_path: bool = False) -> FloatArray:
        """Return the joints at a pose on a branch, by default on the present one.

        InputError for a pose out of reach names the nearest one in reach, with `on_path` on a path of the tool.
        """
        name = branch or self._branch()
        if name not in self._kinematics.branches:
            raise unknown("branch", name, self._kinematics.branches)
        solved = {found.name: found for found in self._branches(pose)}
        if not solved[name].reachable[0]:
            names = self._kinematics.branches  # further solutions of a chain are no branches
            others = [other for other in names if solved[other].reachable[0]]
            hint = f" (the branch {others[0]!r} reaches it)" if others else ""
            passing = passing_text(self._robot, pose, self.composer.joints, name, on_path=on_path)
            reason = solved[name].reason(0)
            raise InputError(
                f"{self._task.words(pose)} is out of reach on the branch {name!r}: {reason}{hint}{passing}"
            )
        return self._with_nearest_turns(solved[name].joints[0])

    def _branch(self) -> str:
        """Return the present branch."""
        return present_branch(self._robot, self.composer.joints)

    def _with_nearest_turns(self, joints: FloatArray) -> FloatArray:
        """Return joints in the turns nearest to the present ones, if these turns are in their limits."""
        nearest = nearest_turns(self._robot, joints, self.composer.joints)
        within = [joint.lower <= q <= joint.upper for joint, q in zip(self._robot.joints, nearest, strict=True)]
        return np.where(within, nearest, joints)
