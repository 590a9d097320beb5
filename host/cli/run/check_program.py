"""`steptwin check pick.toml`: what a program amounts to, step by step."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.arguments import CheckedFile
from steptwin.host.cli.options import with_options
from steptwin.host.cli.output import Columns, print_rows, say, warn
from steptwin.host.common.findings import Findings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from steptwin.host.planning.peaks import Peak
    from steptwin.host.planning.programs import CompiledProgram, Program, StepRow
    from steptwin.host.robots.robot import Robot


def check_program(folder: Path, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a program in a folder for a robot, by default for the one that it names."""
    from steptwin.host.planning.programs import check_names, compile_program, parse_program
    from steptwin.host.twin.motor_limits import motor_forecast, motor_limits

    program = parse_program(text, findings, folder)
    robot = _robot(program, robot_name, findings)
    if robot is None:
        check_names(program, None, findings)
        return CheckedFile()
    compiled = compile_program(program, robot, findings, drives=motor_limits)
    advice = _advice(robot, compiled, findings) if compiled.is_whole else ()
    is_foretold = compiled.is_whole and not findings.messages and program.limits is None
    forecast = motor_forecast(robot, compiled.trajectory) if is_foretold else None
    document = {
        "robot": robot.name,
        "duration_s": compiled.trajectory.duration_s,
        "steps": [_step_document(row) for row in compiled.steps],
        **({"motors": forecast} if forecast else {}),
    }
    waits = ", and its waits for inputs" if compiled.trajectory.waits else ""
    said = (
        f"{robot.name} {program.title or 'program'}: {len(compiled.steps)} steps in"
        f" {compiled.trajectory.duration_s:.3f} s{waits}"
    )

    def tell() -> None:
        _print_steps(compiled.steps)
        if forecast:
            warn(forecast)

    return CheckedFile(document, (tell, said), advice)


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


def _print_steps(steps: "Sequence[StepRow]") -> None:
    """Print a row for each step; the column of passes only if a step is made several times."""
    word = next((row.place.pass_word for row in steps if row.place.passes), "pass")
    passes: Columns = {word: lambda row: row.place.pass_text or "-"}
    texts: Columns = {
        "step": "{0.place.number}",
        **(passes if any(row.place.passes for row in steps) else {}),
        "what": "{0.text}",
    }
    numbers: Columns = {
        "from s": "{0.from_s:.3f}",
        "for s": "{0.duration_s:.3f}",
        "speed": lambda row: _percent_text(_highest(row)[0]),
        "acceleration": lambda row: _percent_text(_highest(row)[1]),
    }
    print_rows({**texts, **numbers}, steps, text_columns=len(texts))
    for row in steps:
        drives = () if row.drives is None else (str(row.drives),)
        say(*(f"{row.place}: {sentence}" for sentence in (*row.passed(), *row.notes, *drives)))


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
        **({"branch_changes": [{"t_s": t_s, "branch": name} for t_s, name in row.changes]} if row.changes else {}),
        **({"notes": list(row.notes)} if row.notes else {}),
        **({"motors": row.drives.to_dict()} if row.drives else {}),
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
