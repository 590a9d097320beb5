"""A step that leads the tool as a file of G-code says."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final

import numpy as np
from pydantic import BeforeValidator

from steptwin.features.fastest.averaged import Averaged
from steptwin.features.fastest.contour import Contour, ContourPath
from steptwin.features.fastest.executed import TimedPath, UntimedError, timed
from steptwin.features.fastest.pieces import FollowedPath
from steptwin.features.fastest.rows import machine_average_s, squares_in_bends
from steptwin.features.fastest.solve import fastest_squares
from steptwin.features.fastest.worthwhile_stops import StoppingPath, doubtful, fastest_with_stops
from steptwin.features.gcode.blocks import GcodeBlock, GcodeFile, read_blocks
from steptwin.features.gcode.cut_runs import CutRun, Placing, curved, cut_runs
from steptwin.features.gcode.dialects import SUFFIXES, Dialect
from steptwin.features.gcode.modal import (
    CornerMode,
    CutMove,
    Dwell,
    GcodeAction,
    HomeMove,
    OutputWord,
    RapidMove,
    actions,
)
from steptwin.features.gcode.origins import Spot
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_errors import wrong
from steptwin.host.common.file_models import FileReading
from steptwin.host.common.file_values import NotNegative, Positive, Within
from steptwin.host.common.findings import judged
from steptwin.host.common.planning_time import check_planning_time, planning_step
from steptwin.host.planning import checks
from steptwin.host.planning.motions.tool_move import present_branch
from steptwin.host.planning.no_way import NO_WAY
from steptwin.host.planning.programs.flow import check_none_gathered, switch_on_way
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.paces import SPEED_PERCENT, JointPace, LawName, OnTheWay, ToolPace
from steptwin.host.planning.programs.pallets import STATION_FRAME, AnyFrame, WorkFrame
from steptwin.host.planning.programs.steps import Step, StepTable
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import SCARA
from steptwin.host.robots.robot import Robot

if TYPE_CHECKING:
    from steptwin.features.fastest.contour import Contour
    from steptwin.host.planning.programs.names import Names

PASSES_MM: Final = 0.05
"""Distance at which a path in a dialect passes its corners where neither file nor step says how."""
_MERGE_MM: Final = 0.02
"""Distance within which short lines of such a path are taken for one line."""
_OUTPUT_KEY: Final = re.compile(r"M[3478]|P(0|[1-9][0-9]{0,2})")


@dataclass(frozen=True, slots=True)
class GcodeStep(Step):
    """Lead the tool as a file of G-code says.

    Attributes:
        file: the file's name, as the program has it.
        content: what is in it.
        frame: where its coordinates are.
        tool_mm: length of what the robot's tool holds, along the frame's z axis.
        feed_max_mm_s: highest feed; infinite without.
        blend_mm: rounding of corners of which the file says nothing; 0 stops there; None for the dialect's usual way.
        outputs: the robot's output for each word.
        speed_percent: part of the joints' limits that G0 uses.
    """

    moves: ClassVar[bool] = True

    file: str
    content: GcodeFile = field(repr=False)
    frame: WorkFrame
    tool_mm: float
    feed_max_mm_s: float
    blend_mm: float | None
    outputs: Mapping[str, str]
    speed_percent: float

    @property
    def keys(self) -> tuple[str, ...]:
        """The key by which G0 becomes slower."""
        return ("speed_percent",)

    @property
    def pace(self) -> JointPace:
        """The pace of G0."""
        return JointPace(law=LawName.FASTEST, speed_percent=self.speed_percent)

    def __str__(self) -> str:
        return f"gcode {self.file}"

    def check(self, names: "Names") -> None:
        for output in self.outputs.values():
            names.output(output)
        if names.robot is None:
            return
        kinematics = make_kinematics(names.robot)
        if not kinematics.task.width:
            raise InputError(f"{names.robot.name} has no tool to lead")
        if kinematics.task is SCARA and not kinematics.attitude_follows:
            return
        for block in self.content.blocks:
            for word in ("A", "C"):
                if word in block.numbers:
                    raise InputError(
                        f"{self.file}: line {block.line}: {word}: the tool of {names.robot.name} has no turn by itself"
                    )

    def add_to(self, moves: Moves) -> None:
        check_none_gathered(moves.legs, "a path of G-code")
        with prefixed(f"{self.file}: "):
            _Cutting(self, moves).make()

    def end(self, moves: Moves) -> FloatArray | None:
        """Return None: where the file ends comes out when it is made."""
        del moves
        return None


def _output_key(key: str) -> str:
    if not _OUTPUT_KEY.fullmatch(key):
        raise wrong(f"{shortened(key)!r} has no output: there are M3, M4, M7, M8, and P0, P1, ...")
    return key


def _words(given: object) -> object:
    """Return the words of a list, or of one text with commas, as the command line has them."""
    return [word.strip() for word in given.split(",")] if isinstance(given, str) else given


@dataclass(frozen=True, slots=True)
class GcodeTable(StepTable):
    """Lead the tool as a file of G-code says.

    Attributes:
        gcode: the file.
        dialect: controller for which it was written; without it, words that are the same for all are read.
        ignore: further words to ignore, and macros.
        frame: name of the frame where its coordinates are.
        tool_mm: length of what the robot's tool holds, along the frame's z axis.
        feed_max_mm_s: highest feed.
        blend_mm: rounding of corners of which the file says nothing; 0 stops there, the default without a dialect.
        speed_percent: part of the joints' limits that G0 uses.
        outputs: the robot's output for each word, such as `{ M3 = "glue" }`.
    """

    suffixes: ClassVar[tuple[str, ...]] = SUFFIXES
    gcode: str
    dialect: Dialect | None = None
    ignore: Annotated[tuple[str, ...], BeforeValidator(_words)] = ()
    frame: AnyFrame = STATION_FRAME
    tool_mm: float = 0.0
    feed_max_mm_s: Positive = np.inf
    blend_mm: NotNegative | None = None
    speed_percent: Annotated[float, Within(0.0, 100.0, open=True)] = SPEED_PERCENT
    outputs: Mapping[Annotated[str, BeforeValidator(_output_key)], str] = field(default_factory=dict)

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> GcodeStep:
        """Return the step; raise InputError, with file, line and word, for what is wrong in the file."""
        table: GcodeTable = judged(cls, values, reading.findings)
        with prefixed(f"{table.gcode}: "):
            content = read_blocks(reading.known.text_of(table.gcode), table.dialect, table.ignore, table.outputs)
            _check_outputs(content.blocks, table.outputs)
        blend_mm = 0.0 if table.blend_mm is None and table.dialect is None else table.blend_mm
        own = (table.tool_mm, table.feed_max_mm_s, blend_mm, table.outputs, table.speed_percent)
        return GcodeStep(table.gcode, content, table.frame, *own)


def _check_outputs(blocks: tuple[GcodeBlock, ...], outputs: Mapping[str, str]) -> None:
    """Raise InputError, with the line, for a word whose output the step does not name."""
    for block in blocks:
        keys = [code for group in ("spindle", "coolant") if (code := block.codes.get(group)) not in (None, "M5", "M9")]
        if "outputs" in block.codes and "P" in block.numbers:
            keys.append(f"P{block.numbers['P']:g}")
        for key in keys:
            if key not in outputs:
                raise InputError(
                    f"line {block.line}: {key}: names no output of the robot; the step says which, such as"
                    f' outputs = {{ {key} = "gripper" }}'
                )


class _Cutting:
    """Adds what a step's file says to the moves."""

    def __init__(self, step: GcodeStep, moves: Moves) -> None:
        self._step, self._moves = step, moves
        self._robot = moves.composer.robot
        self._kinematics = make_kinematics(self._robot)
        pose, task = moves.pose_by({}), self._kinematics.task
        self._placing = Placing(
            step.frame.place + step.frame.turned(np.array([0.0, 0.0, step.tool_mm])),
            step.frame.turned(np.eye(3)),
            step.frame.phi_deg or 0.0,
            () if task.is_flat else pose[3:],
            min(task.width, 4),
        )
        self._waiting: list[CutMove] = []
        self._place: Spot = self._placing.spot(pose)
        """Where the moves have led to; those that are no way do not add up unseen."""
        self._corners, self._stops, self._paths = 0, 0, 0

    def make(self) -> None:
        moves, placing = self._moves, self._placing
        home = self._kinematics.forward(np.array(self._robot.home)[np.newaxis])[0].tolist()
        content, step = self._step.content, self._step
        corner = CornerMode(passes_mm=PASSES_MM, merge_mm=_MERGE_MM) if step.blend_mm is None else CornerMode()
        for action in actions(content.blocks, self._place, placing.spot(home), content.manners, corner):
            check_planning_time()
            if isinstance(action, CutMove) and self._waits(action):
                continue
            self._cut()
            with prefixed(f"line {action.line}: "):
                self._stand_or_go(action)
            match action:
                case RapidMove(_, goal):
                    self._place = goal
                case HomeMove():
                    self._place = placing.spot(home)
        self._cut()
        moves.leg_times, moves.switched = [], ()
        moves.notes = (
            f"{len(content.blocks)} lines: {_many(self._paths, 'path')} of the tool without a stop,"
            f" {_many(self._corners, 'corner')} rounded, {_many(self._stops, 'stop')} at corners",
            *content.remarks(),
        )

    def _waits(self, move: CutMove) -> bool:
        """Let a move wait for those that it flows into; return False for one that leads nowhere."""
        if move.arc is None:
            move = replace(move, start=(*self._place[:3], move.start[3]))
            if max(abs(a - b) for a, b in zip(move.start[:3], move.goal[:3], strict=True)) <= NO_WAY:
                return False
        self._waiting.append(move)
        self._place = move.goal
        return True

    def _stand_or_go(self, action: GcodeAction) -> None:
        moves, pace, outputs = self._moves, self._step.pace, self._step.outputs
        match action:
            case RapidMove(_, goal):
                moves.go(moves.joints_of(self._placing.pose(goal)), pace)
            case HomeMove():
                moves.go(np.array(self._robot.home), pace)
            case Dwell(_, time_s):
                if time_s:
                    moves.composer.pause(max(1, round(1000 * time_s)) / 1000)
            case OutputWord(_, key, on):
                moves.composer.switch(outputs[key], on=on)
            case CutMove():  # a turn on the spot
                for key, on in action.changes:
                    moves.composer.switch(outputs[key], on=on)
                moves.line(self._placing.pose(action.goal), ToolPace(speed_mm_s=action.feed_mm_s, law=LawName.FASTEST))

    def _cut(self) -> None:
        """Make the moves that wait, without a stop but where corners need it."""
        if not self._waiting:
            return
        for way in self._better(list(self._ways(self._waiting))):
            self._take(way)
        self._waiting.clear()

    def _ways(self, moves: Sequence[CutMove]) -> Iterator["_Way"]:
        """Yield the runs of moves with their joints, each from where the one before ends."""
        joints = self._moves.composer.joints
        for run in cut_runs(moves, self._placing, self._step.blend_mm or 0.0):
            way = _Way.of(self._robot, joints, self._step, run)
            yield way
            joints = way.path.followed.end

    def _better(self, ways: list["_Way"]) -> list["_Way"]:
        """Return the runs, or those with short lines taken for arcs if these are faster."""
        moves = curved(self._waiting)
        if len(moves) == len(self._waiting):
            return ways
        try:
            with_arcs = list(self._ways(moves))
        except InputError:  # an arc is out of reach where its lines are not
            return ways
        return min(ways, with_arcs, key=lambda runs: sum(way.least_s for way in runs))

    def _take(self, way: "_Way") -> None:
        composer, run = self._moves.composer, way.run
        self._check_range(way)
        begins_s = composer.now_s
        with planning_step(f"{self._step.file}: {way.where(0.0)} a path of {len(run.contour.lengths_mm)} pieces"):
            way, made = way.fastest(round(1000 * begins_s))
        run, stops = way.run, len(way.run.stops)
        self._paths, self._stops = self._paths + 1 + stops, self._stops + stops
        self._corners += int(run.contour.roundings.sum())
        composer.take(made.motion)
        changing = [i for i, move in enumerate(run.moves) if move.changes]
        times_s = made.law.times_at(run.begins_mm[changing])
        for i, time_s in zip(changing, times_s.tolist(), strict=True):
            changes = [OnTheWay(self._step.outputs[key], on, 0.0) for key, on in run.moves[i].changes]
            switch_on_way(composer, changes, [time_s if i else 0.0] * len(changes), begins_s)

    def _check_range(self, way: "_Way") -> None:
        """Raise InputError for the first line on which a joint leaves its range, with how far it would go there."""
        at_mm = way.path.followed.guide_mm
        for i, joint in enumerate(self._robot.joints):
            column = way.path.followed.guides[:, i]
            outside = np.flatnonzero((column < joint.lower - NO_WAY) | (column > joint.upper + NO_WAY))
            if len(outside):
                line, end_mm = _line_at(way.run.contour, float(at_mm[outside[0]]))
                of_line = outside[at_mm[outside] <= end_mm]
                reached = np.append(column[of_line], np.interp(end_mm, at_mm, column))
                beyond = np.maximum(joint.lower - reached, reached - joint.upper)
                with prefixed(f"line {line}: "):
                    checks.check_within(joint, float(reached[np.argmax(beyond)]))


def _line_at(contour: Contour, at_mm: float) -> tuple[int, float]:
    """Return the line of a place on a path, and the length at which the line's pieces end."""
    piece = int(contour.place_of(np.array([at_mm]))[0][0])
    line = contour.lines[piece]
    while piece + 1 < len(contour.lines) and contour.lines[piece + 1] == line:
        piece += 1
    return int(line), float(contour.starts_mm[piece] + contour.lengths_mm[piece])


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """A run of a file with the joints that follow it, from joints of shape (joints,) on."""

    robot: Robot
    start: FloatArray
    step: GcodeStep
    run: CutRun
    path: ContourPath

    @classmethod
    def of(cls, robot: Robot, start: FloatArray, step: GcodeStep, run: CutRun) -> "_Way":
        contour = run.contour
        np.minimum(contour.speeds_mm_s, step.feed_max_mm_s, out=contour.speeds_mm_s)
        branch = present_branch(robot, start)
        followed = FollowedPath.along(robot, contour, branch, start, partial(_where, contour))
        return cls(robot, start, step, run, ContourPath(robot, contour, followed))

    def where(self, at_mm: float) -> str:
        """Return the line that makes a place, in words."""
        return _where(self.run.contour, at_mm)

    def fastest(self, from_ms: int) -> tuple["_Way", TimedPath]:
        """Return the way with the stops that make it faster, and its motion, which begins at a time of the program."""
        run = self.run
        corners = doubtful(self.robot, self.path, run.begins_mm[1:], run.radii_mm)

        def stop_in(corners: Sequence[int]) -> StoppingPath:
            way = self._stopping_in(corners)
            return StoppingPath(way.path, way.run.stops_mm, machine_average_s(self.robot, way.path.rates()))

        def make(corners: Sequence[int]) -> tuple[_Way, TimedPath]:
            way = self._stopping_in(corners)
            return way, way.timed(from_ms)

        return fastest_with_stops(self.robot, corners, stop_in, make)

    @property
    def least_s(self) -> float:
        """About how long its motion takes, if bends are passed so slowly that they may be averaged."""
        rates, limits = self.path.rates(), self.path.limits()
        average_s = machine_average_s(self.robot, rates)
        rows = limits.rows(self.robot, rates)
        in_bends = squares_in_bends(self.robot, rates, limits, average_s)
        squares = fastest_squares(rates.s, replace(rows, x_max=np.minimum(rows.x_max, in_bends)))
        return Averaged.of(rates.s, squares, average_s).duration_s

    def timed(self, from_ms: int) -> TimedPath:
        """Return its motion; raise UntimedError, with the line, if there is none."""
        average_s = machine_average_s(self.robot, self.path.rates())
        try:
            return timed(self.robot, self.path, average_s, from_ms, stops=self.run.stops_mm)
        except UntimedError as error:
            raise UntimedError(f"{self.where(error.s)} {error}", error.s) from error

    def _stopping_in(self, corners: Sequence[int]) -> "_Way":
        return _Way.of(self.robot, self.start, self.step, self.run.stopping_in(corners)) if corners else self


def _where(contour: Contour, at_mm: float) -> str:
    return f"line {contour.lines[contour.place_of(np.array([at_mm]))[0][0]]}:"


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
