"""`steptwin check pick.toml`: what a program amounts to, step by step."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.arguments import with_options
from steptwin.host.cli.output import print_table, say
from steptwin.host.cli.run.checked_file import CheckedFile
from steptwin.host.common.findings import Findings

if TYPE_CHECKING:
    from steptwin.host.planning.peaks import Peak
    from steptwin.host.planning.programs import CompiledProgram, Program, StepRow
    from steptwin.host.robots.robot import Robot


def check_program(folder: Path, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a program in a folder for a robot, by default for the one that it names."""
    from steptwin.host.planning.programs import check_names, compile_program, parse_program

    program = parse_program(text, findings, folder)
    robot = _robot(program, robot_name, findings)
    if robot is None:
        check_names(program, None, findings)
        return CheckedFile({})
    compiled = compile_program(program, robot, findings)
    advice = _advice(robot, compiled, findings) if compiled.is_whole else ()
    document = {
        "robot": robot.name,
        "duration_s": compiled.trajectory.duration_s,
        "steps": [_step_document(row) for row in compiled.steps],
    }
    return CheckedFile(document, lambda: _print(robot, program, compiled), advice)


def _robot(program: "Program", name: str | None, findings: Findings) -> "Robot | None":
    """Return the robot with a name, by default the program's own; None, with a finding, if it is unknown or wrong."""
    from steptwin.host.planning.programs import load_own_robot
    from steptwin.host.robots import load_robot

    with findings.collecting():
        return load_own_robot(program) if name is None else load_robot(name)
    return None


def _advice(robot: "Robot", compiled: "CompiledProgram", findings: Findings) -> tuple[str, ...]:
    """Plan the whole program; return which stretch makes it slow enough, if it is too fast."""
    from steptwin.host.planning.checks import TooFastError
    from steptwin.host.planning.planner import plan

    with findings.collecting():
        try:
            plan(robot, compiled.trajectory)
        except TooFastError as error:
            if not findings.messages:
                raise
            return (f"or the whole program: {with_options(error.advice, 'stretch')}; --stretch auto finds it",)
    return ()


def _print(robot: "Robot", program: "Program", compiled: "CompiledProgram") -> None:
    with_passes = any(row.place.passes for row in compiled.steps)
    rows = [
        [
            row.place.number,
            *([row.place.pass_text or "-"] if with_passes else []),
            row.text,
            f"{row.from_s:.3f}",
            f"{row.duration_s:.3f}",
            *map(_percent_text, _highest(row)),
        ]
        for row in compiled.steps
    ]
    keys = ["step", *(["pass"] if with_passes else []), "what"]
    print_table([*keys, "from s", "for s", "speed", "acceleration"], rows, text_columns=len(keys))
    waits = ", and its waits for inputs" if compiled.trajectory.waits else ""
    duration_s = compiled.trajectory.duration_s
    say(f"{robot.name} {program.title or 'program'}: {len(rows)} steps in {duration_s:.3f} s{waits}")


def _step_document(row: "StepRow") -> dict[str, Any]:
    speed, acceleration = _highest(row)
    return {
        "number": row.place.number,
        "pass": list(row.place.passes),
        "text": row.text,
        "from_s": row.from_s,
        "duration_s": row.duration_s,
        "speed_percent": speed.percent if speed else 0.0,
        "acceleration_percent": acceleration.percent if acceleration else 0.0,
    }


def _highest(row: "StepRow") -> "tuple[Peak | None, Peak | None]":
    """Return the peaks of speed and acceleration that are nearest to their limits; None in a step without motion."""
    from steptwin.host.planning.peaks import Quantity

    speeds = [peak for peak in row.peaks if peak.quantity in (Quantity.SPEED, Quantity.AXIS_SPEED)]
    of_acceleration = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)
    accelerations = [peak for peak in row.peaks if peak.quantity in of_acceleration]
    return _nearest_to_limit(speeds), _nearest_to_limit(accelerations)


def _nearest_to_limit(peaks: "list[Peak]") -> "Peak | None":
    return max(peaks, key=lambda peak: peak.percent, default=None)


def _percent_text(peak: "Peak | None") -> str:
    return f"{peak.percent:.0f} % {peak.joint}" if peak is not None and peak.value else "-"
