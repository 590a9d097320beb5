"""`steptwin check FILE`: print all errors in a file of your own, or its content."""

from collections.abc import Sequence
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, CheckedFile, PlanningOptions
from steptwin.host.cli.options import argument, of_features, option, with_options
from steptwin.host.cli.output import Columns, print_rows, say, warn
from steptwin.host.cli.run.check_robot import check_robot
from steptwin.host.cli.run.chosen_motion import keys_of
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import FileKind, FileOptions, drive_model, giving
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX, check_size
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import toml_table

if TYPE_CHECKING:
    from steptwin.host.planning.peaks import Peak
    from steptwin.host.planning.programs import CompiledProgram, Program, StepRow
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class StepFileOptions:
    """The options of a file that a step of a program runs."""

    pairs: list[str] | None = option(
        "NAME=VALUE", "Set a key of the step that runs a file. Repeatable.", "--option", "-o"
    )
    files: Sequence[FileOptions] = of_features("file_options")

    def keys(self, file: str) -> dict[str, str]:
        """Return the keys of the step; raise InputError for an option of another kind of file."""
        return {**name_value_pairs(self.pairs or []), **keys_of(self.files, file)}


@command("my-arm.toml", "docs/programs/ar4-mk3.toml")
def check(
    answer: AnswerOptions,
    planning: PlanningOptions,
    of_file: StepFileOptions,
    file: str = argument(
        "FILE", "A robot, a program, or another file of StepTwin, in TOML; or a file that a step runs.", MISSING
    ),
    robot: str | None = argument("ROBOT", "The robot for a program that does not name it."),
) -> None:
    """Say everything that is wrong in a file at once; otherwise print what it amounts to.

    Of a robot: joints, ranges, steps and highest speeds, and how far the tool reaches. Of a program: its steps, with
    durations and peaks in percent of the joints' limits. A file with something wrong ends with exit code 2.
    """
    from steptwin.host.planning.programs.program_file import verb_of_suffix
    from steptwin.host.planning.programs.step_files import is_step_file, plain_message, step_program
    from steptwin.host.planning.trajectory_file import is_trajectory_file

    if is_trajectory_file(file):
        raise InputError(
            f"{file}: is a trajectory: `steptwin run ROBOT {file}` says what is wrong before anything moves"
        )
    keys, findings = of_file.keys(file), Findings()
    if is_step_file(file):
        name = Path(file).name
        kind = FileKind(verb_of_suffix()[Path(file).suffix.lower()], (), check_program)
        with planning.bounded(), prefixed(f"{file}: "):
            checked = check_program(file, step_program(name, keys), robot, findings)
        findings = Findings([plain_message(name, message) for message in findings.messages])
    else:
        if keys:
            raise InputError(f"option {next(iter(keys))}: {file} is not a file that a step runs")
        kind, checked = _check_toml(file, robot, planning, findings)
    wrong = findings.messages
    if wrong and not answer.as_json:
        say(*(f"{file}: {message}" for message in (*wrong, *checked.advice)), err=True)
    else:
        answer.tell({"file": file, "kind": kind.name, "findings": wrong, **checked.document}, *checked.words)
    if wrong:
        raise typer.Exit(InputError.exit_code)


def _check_toml(
    file: str, robot: str | None, planning: PlanningOptions, findings: Findings
) -> tuple[FileKind, CheckedFile]:
    """Check a file in TOML; return its kind and what it amounts to."""
    kinds = file_kinds()
    with prefixed(f"{file}: "):
        text = read_text(file, max(kind.bytes_max for kind in kinds))
        marked = [kind.bytes_max for kind in kinds if kind.mark is not None and kind.mark.search(text)]
        check_size(len(text), max(marked, default=PROGRAM_BYTES_MAX))
        table = toml_table(text)
        kind = next((kind for kind in kinds if any(key in table for key in kind.keys)), None)
        if kind is None:
            telling = ", ".join(key for kind in kinds for key in kind.keys)
            raise InputError(f"has none of {telling}: it is no {' and no '.join(kind.name for kind in kinds)}")
    with planning.bounded(), prefixed(f"{file}: "):
        return kind, kind.check(file, text, robot, findings)


def file_kinds() -> list[FileKind]:
    """Return the kinds of files that can be checked."""
    of_features = [kind for _, kinds in giving("file_kinds") for kind in kinds()]
    program = FileKind("program", ("step", "steps", "sequences"), check_program)
    return [program, *of_features, FileKind("robot", ("kinematics", "joints", "board"), _check_robot)]


def _check_robot(_path: str, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    return check_robot(text, robot_name, findings)


def check_program(path: str, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a program for a robot, by default for the one that it names."""
    from steptwin.host.planning.drives import known_drives
    from steptwin.host.planning.programs import check_names, compile_program, parse_program

    program = parse_program(text, findings, Path(path).parent)
    robot = _robot(program, robot_name, findings)
    if robot is None:
        check_names(program, None, findings)
        return CheckedFile()
    compiled = compile_program(program, robot, findings, drives=known_drives())
    advice = _advice(robot, compiled, findings) if compiled.is_whole else ()
    is_foretold = compiled.is_whole and not findings.messages and program.limits is None
    model = drive_model()
    forecast = model.forecast(robot, compiled.executed) if model and is_foretold else None
    document = {
        "robot": robot.name,
        "duration_s": compiled.executed.duration_s,
        "steps": [_step_document(row) for row in compiled.steps],
        **({model.name: forecast} if model and forecast else {}),
    }
    waits = ", and its waits for inputs" if compiled.motion.waits else ""
    said = (
        f"{robot.name} {program.title or 'program'}: {len(compiled.steps)} steps in"
        f" {compiled.executed.duration_s:.3f} s{waits}"
    )

    def tell() -> None:
        _print_steps(compiled.steps)
        if compiled.changed is not None:
            say(compiled.changed.described())
        if forecast:
            warn(forecast)

    return CheckedFile(document, (tell, said), advice)


def _robot(program: "Program", name: str | None, findings: Findings) -> "Robot | None":
    """Return the robot with a name, by default the program's own; None, with an error in `findings`, if invalid."""
    from steptwin.host.planning.programs import load_own_robot
    from steptwin.host.robots import load_robot

    with findings.collecting():
        return load_own_robot(program) if name is None else load_robot(name)
    return None


def _advice(robot: "Robot", compiled: "CompiledProgram", findings: Findings) -> tuple[str, ...]:
    """Plan the whole program; return the stretch that makes it slow enough, if it is too fast."""
    from steptwin.host.planning.checks import TooFastError
    from steptwin.host.planning.planner import plan

    with findings.collecting():
        try:
            plan(robot, compiled.motion)
        except TooFastError as error:
            if not findings.messages:
                raise
            return (f"or the whole program: {with_options(error.advice, 'stretch')}; --stretch auto finds it",)
    return ()


def _print_steps(steps: "Sequence[StepRow]") -> None:
    """Print a row for each step; the column of passes only if a step is repeated."""
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
    model, (speed, acceleration) = drive_model(), _highest(row)
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
        **({model.name: row.drives.to_dict()} if model and row.drives else {}),
    }


def _highest(row: "StepRow") -> "tuple[Peak | None, Peak | None]":
    """Return the peaks of speed and acceleration nearest to their limits; None in a step without motion."""
    from steptwin.host.planning.peaks import Quantity

    speeds = [peak for peak in row.peaks if peak.quantity in (Quantity.SPEED, Quantity.AXIS_SPEED)]
    of_acceleration = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)
    accelerations = [peak for peak in row.peaks if peak.quantity in of_acceleration]
    return _nearest_to_limit(speeds), _nearest_to_limit(accelerations)


def _nearest_to_limit(peaks: "list[Peak]") -> "Peak | None":
    return max(peaks, key=lambda peak: peak.percent, default=None)


def _percent_text(peak: "Peak | None") -> str:
    return f"{peak.percent:.0f} % {peak.joint}" if peak is not None and peak.value else "-"
