"""Turn a program into the robot's motion, and into a table of its steps with their peaks beside the limits."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.bad_input import unknown, whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning import checks
from steptwin.host.planning.motions.sequence import Sequence
from steptwin.host.planning.peaks import Peak, speed_peaks
from steptwin.host.planning.planner import stretch_that_passes
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.program import AnyStep, Call, Program, Repeat
from steptwin.host.planning.programs.steps import Step
from steptwin.host.planning.samples import Samples
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots import SUFFIX, load_robot
from steptwin.host.robots.robot import Robot

STEPS_MAX: Final = 5_000
"""Number of steps, repetitions and calls written out, that a program may have."""


@dataclass(frozen=True, slots=True)
class StepRow:
    """A step of a compiled program.

    Attributes:
        number: number in the program, with those of the sequence or repetition it is in, as in `3.2`.
        text: the step in words.
        from_s: time at which it begins.
        duration_s: its duration.
        peaks: highest speed and acceleration of each joint in it.
    """

    number: str
    text: str
    from_s: float
    duration_s: float
    peaks: tuple[Peak, ...]


@dataclass(frozen=True, slots=True)
class CompiledProgram:
    """A program's motion and its steps; it is incomplete if there were findings."""

    trajectory: Sequence
    steps: tuple[StepRow, ...]


def compile_program(program: Program, robot: Robot, findings: Findings | None = None) -> CompiledProgram:
    """Return a program's motion for a robot.

    Without `findings` it raises InputError for the first step that the robot cannot make; speeds are left to the
    planner, which can stretch the motion. With them it goes on: a step that exceeds a limit is found and made, one that
    cannot be made ends the program.
    """
    found = Findings() if findings is None else findings
    rows: list[StepRow] = []
    moves = Moves(robot, {}, None)
    with found.collecting():
        _check_robot(program, robot)
        moves = Moves(robot, program.positions, program.start)
        for number, step in _written_out(program, program.steps, "", ()):
            if not _add(moves, robot, number, step, rows, found):
                break
            if findings is not None:
                with found.collecting(f"step {number} ({step}): "):
                    _check_speeds(robot, moves.composer.last_part(rows[-1].from_s), rows[-1].peaks)
        if not rows and not found.messages:
            raise InputError("the program does not move, switch or wait")
    if findings is None:
        found.raise_first()
    return CompiledProgram(moves.composer.sequence(), tuple(rows))


def _check_robot(program: Program, robot: Robot) -> None:
    """Raise InputError unless the program and its file of positions are for the robot."""
    if not _names(program.robot, robot):
        raise InputError(f"robot: the program is for {program.robot}, not for {robot.name}")
    if program.positions_for not in (None, robot.name):
        raise InputError(f"positions_file: its positions are for {program.positions_for}, not for {robot.name}")


def _names(given: str | None, robot: Robot) -> bool:
    """Return whether a program names the robot, by its name or by the path of its file, or names none."""
    if given is None or given == robot.name:
        return True
    return given.endswith(SUFFIX) and load_robot(given).name == robot.name


def _written_out(
    program: Program, steps: tuple[AnyStep, ...], above: str, callers: tuple[str, ...]
) -> Iterator[tuple[str, Step]]:
    """Yield each step with its number, repetitions and calls written out; raise InputError for a call of itself."""
    for index, step in enumerate(steps, 1):
        number = f"{above}{index}"
        match step:
            case Repeat(times, inner):
                for _ in range(times):
                    yield from _written_out(program, inner, f"{number}.", callers)
            case Call(name):
                if name not in program.sequences:
                    raise InputError(f"step {number}: {unknown('sequence', name, program.sequences)}")
                if name in callers:
                    raise InputError(f"step {number}: call: the sequence {name!r} calls itself")
                yield from _written_out(program, program.sequences[name], f"{number}.", (*callers, name))
            case _:
                yield number, step


def _add(moves: Moves, robot: Robot, number: str, step: Step, rows: list[StepRow], found: Findings) -> bool:
    """Add a step and its row; return whether the program can go on after it."""
    composer = moves.composer
    place = f"step {number} ({step}): "
    from_s = composer.now_s
    made = False
    with found.collecting(place):
        if len(rows) >= STEPS_MAX:
            raise InputError(f"a program has at most {STEPS_MAX} steps, repetitions written out")
        moves.place = f"step {number}"
        step.add_to(moves)
        made = True
    if not made:
        return False
    part = composer.last_part(from_s)
    peaks: tuple[Peak, ...] = ()
    if part is not None:
        samples = _samples(part, from_s)
        peaks = tuple(speed_peaks(robot, samples))
        with found.collecting(place):
            checks.check_positions(robot, samples)
    rows.append(StepRow(number, str(step), from_s, composer.now_s - from_s, peaks))
    return True


def _check_speeds(robot: Robot, part: Trajectory | None, peaks: tuple[Peak, ...]) -> None:
    try:
        checks.check_peaks(peaks)
    except checks.TooFastError as error:
        if part is None:
            raise
        raise InputError(f"{error}; {stretch_that_passes(robot, part, error):g} times slower passes") from error


def _samples(part: Trajectory, from_s: float) -> Samples:
    """Sample a part of the motion, with times of the whole motion."""
    end_ms = whole_ms("the duration", part.duration_s)
    breakpoints_ms = [whole_ms("a breakpoint", t_s) for t_s in part.breakpoints_s]
    samples = Samples.of(part, np.array(sorted({0, *breakpoints_ms, end_ms})))
    return samples._replace(t_s=samples.t_s + from_s)
