"""`steptwin motors DIR|ROBOT`: turn the rotors of a stored run, or compare a robot's motors with its needs."""

from dataclasses import dataclass
from dataclasses import replace as replace_fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from steptwin.features.motors.report import (
    LoadOptions,
    check_motors,
    keep_cycles,
    keep_pictures,
    margins_of,
    motors_of,
    print_margins,
    print_motors,
    warn_of_payloads,
    write_cycles,
    write_motor_pictures,
)
from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, Replace, RobotOptions
from steptwin.host.cli.options import argument, naming_options, option, switch
from steptwin.host.cli.output import Columns, print_rows, print_table, say, warn
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from steptwin.features.motors.sizing.fitting import Fit, JointFit
    from steptwin.features.motors.turning.ramps import JointRamp
    from steptwin.host.robots.robot import Robot


def report_fits(answer: AnswerOptions, robot: "Robot", current_a: float | None) -> None:
    """Print the torque margins of a robot's motors, and of the catalogue's, at the limits of its joints."""
    from steptwin.features.motors.sizing.fitting import fits_of
    from steptwin.features.motors.turning import check_described
    from steptwin.features.motors.turning.driving import check_current

    dynamics = check_described(robot)
    if current_a is not None:
        with naming_options(current_a="--current"):
            check_current(current_a, robot.board.profile.chip)
    fits = fits_of(robot, current_a)
    head: dict[str, Any] = {"payload_kg": dynamics.payload_kg, "supply_v": dynamics.supply_v}
    answer.tell(
        {"robot": robot.name, **head, "assumed": ["masses"], "joints": [fit.to_dict() for fit in fits]},
        lambda: _print_fits(fits),
        f"motors: with {dynamics.payload_kg:g} kg at the tool and {dynamics.supply_v:g} V ([A] masses)",
    )


def _print_fits(fits: "tuple[JointFit, ...]") -> None:
    from steptwin.features.motors.turning.verdict import MARGIN_MIN

    print_rows(_OWN, fits, text_columns=2)
    say("")
    print_ramps(fits)
    say("")
    _print_pull_out(fits)
    say("")
    _print_others(fits)
    say(
        f"A motor of the catalogue would do where {100 * MARGIN_MIN:.0f} % is left; where not, the speed at which its"
        " torque is short follows",
    )
    for fit in fits:
        if not fit.own.would_do:
            warn(f"{fit.name}: {fit.own.motor}: {_shortage(fit.own)}")
    warn_of_steep_homings(fits)


_OWN: Final[Columns] = {
    "joint": "{0.name}",
    "motor": "{0.own.motor}",
    "A": "{0.own.current_a:.2f}",
    "needs Nm": "{0.own.torque_needed_nm:.3f}",
    "has Nm": "{0.own.torque_available_nm:.3f}",
    "margin %": lambda fit: f"{100 * fit.own.margin:.0f}",
    "at rpm": "{0.own.rpm:.0f}",
    "top rpm": "{0.rpm_max:.0f}",
    "inertia gcm2": lambda fit: f"{1e7 * fit.inertia_kgm2:.0f}",
    "f0 Hz": "{0.natural_hz:.1f}",
}


def warn_of_steep_homings(fits: "tuple[JointFit, ...]") -> None:
    """Warn of each joint that accelerates harder in its homing than its motor can."""
    from steptwin.features.motors.turning.ramps import steep_homing

    for fit in fits:
        if fit.homing is not None and fit.homing.too_steep:
            warn(steep_homing(fit.name, fit.unit, fit.homing))


def print_ramps(fits: "tuple[JointFit, ...]") -> None:
    """Print each joint's acceleration limits, in motion and in homing, beside those that the motors allow."""
    heads = ["joint", "unit", "acceleration_max", "motors manage", "homing", "motors manage"]
    rows = [
        [
            fit.name,
            f"{fit.unit}/s2",
            *_accelerations_text(fit.moving, fit.name),
            *(("-", "-") if fit.homing is None else _accelerations_text(fit.homing, fit.name)),
        ]
        for fit in fits
    ]
    print_table(heads, rows, text_columns=2)


def _accelerations_text(ramp: "JointRamp", name: str) -> tuple[str, str]:
    """Return the set and the highest possible acceleration as text; name the limiting joint if it is another one."""
    weakest = "" if ramp.weakest == name else f"{ramp.weakest}: "
    return f"{ramp.asked:g}", f"{weakest}{ramp.managed:.0f}"


def _print_pull_out(fits: "tuple[JointFit, ...]") -> None:
    from steptwin.features.motors.sizing.fitting import TABLE_RPM

    heads = ["Nm at rpm", *(f"{rpm:g}" for rpm in TABLE_RPM)]
    print_table(heads, [[fit.name, *(f"{torque:.3f}" for torque in fit.pull_out_nm)] for fit in fits])


def _print_others(fits: "tuple[JointFit, ...]") -> None:
    heads = ["margin %", "A", *(fit.name for fit in fits)]
    rows = [
        [motor.motor, f"{motor.current_a:.2f}", *(_cell(fit.others[row]) for fit in fits)]
        for row, motor in enumerate(fits[0].others)
    ]
    print_table(heads, rows)


def _cell(fit: "Fit") -> str:
    """Return the margin as text; if the motor is too weak, with the speed of the least margin."""
    percent = f"{100 * fit.margin:.0f}" if fit.margin > -1.0 else "none"
    return percent if fit.would_do else f"{percent} at {fit.rpm:.0f}"


def _shortage(fit: "Fit") -> str:
    return f"needs {fit.torque_needed_nm:.3f} of {fit.torque_available_nm:.3f} Nm at {fit.rpm:.0f} turns a minute"


@dataclass(frozen=True, slots=True)
class CycleOptions:
    """Options for the duration of a program by torque reserve."""

    program: str | None = option("FILE", "Program of ROBOT: how long it takes by the torque that is to be left.")
    instead: list[str] | None = option(
        "JOINT=MOTOR", "With --program: another motor of the catalogue beside the robot's own; repeatable."
    )


def report_cycles(answer: AnswerOptions, robot: "Robot", asked: CycleOptions, out: Path | None) -> None:
    """Print the duration of a program for each torque reserve of the motors, and draw it."""
    from steptwin.features.motors.sizing.fitting import cycle_times, with_motors_of
    from steptwin.host.planning.programs import compile_program, read_program

    path = asked.program or ""
    program = read_program(path)
    models = name_value_pairs(asked.instead or [])
    with prefixed("--instead: "):
        other = with_motors_of(robot, models)
    with prefixed(f"{path}: "):
        by_joints_s = compile_program(replace_fields(program, limits=None), robot).executed.duration_s
        cycles = {"the robot's own motors": cycle_times(program, robot)}
        if models:
            cycles["with " + " ".join(f"{name}={model}" for name, model in models.items())] = cycle_times(
                program, other
            )
    document = {
        "robot": robot.name,
        "program": path,
        "by_joints_s": by_joints_s,
        "cycles": {name: [each.to_dict() for each in times] for name, times in cycles.items()},
    }
    rows = [(name, each) for name, times in cycles.items() for each in times]
    answer.tell(
        document, lambda: print_rows(_CYCLES, rows, text_columns=1), f"by the joints alone: {by_joints_s:.3f} s"
    )
    if out is not None:
        write_cycles(out, robot, cycles, by_joints_s)
        answer.add_files("the picture is", out)


_CYCLES: Final[Columns] = {
    "motors": "{0[0]}",
    "left %": "{0[1].left_percent:g}",
    "lasts s": lambda row: "-" if row[1].duration_s is None else f"{row[1].duration_s:.3f}",
    "least left": lambda row: row[1].joint or "-",
    "tries": lambda row: str(row[1].tries or "-"),
}


@command("out/store --payload 1.5 --margin", "lab-scara --supply 12")
def motors(
    load: LoadOptions,
    which: RobotOptions,
    cycle: CycleOptions,
    subject: str | None = argument(
        "DIR|ROBOT", "Folder written by `steptwin run --out`, or a robot or its .toml file."
    ),
    margin: bool = switch("Search the lowest current, the largest payload and the fastest motion that keep step."),
    out: Path | None = option("DIR", "Folder for pictures of a run's motors."),
    replace: Replace = False,
) -> None:
    """Turn the rotors of a stored run by its phase currents, with the arm's masses; exit code 1 if one slips.

    The drivers count steps whether a rotor follows or not: this tells what the motors would really do. Of a robot it
    tells, without a run, the motors' pull-out torques, and which motors would do at the joints' limits; with --program
    how long a program takes by the torque that its motors are to have left.
    """
    if which.robot_file is not None or subject is None or _is_robot(subject):
        robot = load.on(which.robot(subject))
        if cycle.program is not None:
            keep_cycles(out, replace=replace)
            report_cycles(which, robot, cycle, out)
            return
        if cycle.instead:
            raise InputError(f"--instead {cycle.instead[0]}: goes with --program")
        for option, given in (("--margin", margin), ("--out", out is not None)):
            if given:
                raise InputError(f"{option}: is for the folder of a run, not for a robot")
        report_fits(which, robot, load.current)
        return
    if cycle.program is not None or cycle.instead:
        raise InputError("--program: is for a robot, not for the folder of a run")
    if out is not None:
        keep_pictures(out, replace=replace)
    _report_run(which, Path(subject), load, out, margin=margin)


def _is_robot(subject: str) -> bool:
    """Return True for a robot's name or file, False for a run folder; raise InputError if it is neither."""
    from steptwin.host.robots import robot_names

    if subject in robot_names() or subject.endswith(".toml"):
        return True
    if not Path(subject).exists() and Path(subject).name == subject:
        raise unknown("robot or folder of a run", subject, robot_names())
    return False


def _report_run(answer: AnswerOptions, folder: Path, load: LoadOptions, out: Path | None, *, margin: bool) -> None:
    from steptwin.host.record.folder import read_run

    run = read_run(folder)
    with prefixed(f"{folder}: "):
        check_motors(run.robot)
    robot = load.on(run.robot)
    ran = motors_of(robot, run.comparison, run.report.driver_profile, load.current)
    margins = margins_of(ran, run.comparison) if margin else None
    document = {"robot": robot.name, "job": run.report.document["job"], "motors": ran.verdict.to_dict()}
    in_words: list[str | Callable[[], None]] = [
        f"{robot.name}: {ran.verdict.answer}",
        lambda: print_motors(ran.verdict),
        lambda: warn_of_payloads(run.report.document, ran.verdict.payload_kg),
    ]
    if margins is not None:
        document["margins"] = margins.to_dict()
        in_words.append(lambda: print_margins(margins))
    answer.tell(document, *in_words)
    if out is not None:
        write_motor_pictures(out, ran, run.report.run)
        answer.add_files("pictures of the motors are", out)
    end_unless(ran.verdict.kept_step)
