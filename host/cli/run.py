"""`steptwin run ROBOT JOB`: plan, stream, emulate, verify."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from host.cli.app import app
from host.cli.arguments import AsJson, RobotFile, joint_values, name_value_pairs, robot_and_rest
from host.cli.output import print_json, print_table
from host.errors import DeviceFaultError, InputError

if TYPE_CHECKING:
    from controller.backend import Kernel
    from host.client import Progress
    from host.robot import Robot
    from host.run import Outcome
    from host.trajectory import Trajectory

EXIT_NOT_VERIFIED = 1
_USUAL_DRIVERS = "chip-330pf"
"""Need not be said."""


class KernelChoice(StrEnum):
    """Which form of the firmware's kernel runs; both make the same edges."""

    AUTO = "auto"
    PYTHON = "python"
    NUMBA = "numba"


@app.command()
def run(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT JOB|FILE",
            help="The robot, and one of its jobs, as `steptwin jobs ROBOT` lists them, or a trajectory in a file:"
            " CSV with a header t,JOINT,... or JSON in the shape of ROS' JointTrajectory, in s, mm and degrees.",
        ),
    ] = None,
    robot_file: RobotFile = None,
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write report, edges, bus log and pictures into this folder.")
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option("--option", "-o", metavar="NAME=VALUE", help="Set one of the job's options.")
    ] = None,
    elbow: Annotated[str | None, typer.Option(metavar="right|left", help="Short for --option elbow=...")] = None,
    stand_at: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="Where the emulated machine stands; by default at the job's start."),
    ] = None,
    cut_stream: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", min=0.0, help="Stop sending points there, as a host that hangs would."),
    ] = None,
    driver_profile: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="The drivers that the emulated board really has, without telling planner or firmware: chip-100pf,"
            " chip-330pf, chip-1000pf, 3a-module or slow-blue-board.",
        ),
    ] = None,
    kernel: Annotated[
        KernelChoice, typer.Option(help="Plain Python or compiled; auto takes the fastest.")
    ] = KernelChoice.AUTO,
    as_json: AsJson = False,
) -> None:
    """Run a job or a trajectory file on an emulated board in virtual time and verify every pulse."""
    from host.planner import plan
    from host.run import execute
    from host.run_folder import prepare_folder, write_folder

    loaded, rest = robot_and_rest(words or [], robot_file)
    job = _only(rest)
    options = name_value_pairs(option or []) | ({"elbow": elbow} if elbow is not None else {})
    planned = plan(loaded, _trajectory(loaded, job, options))
    standing = None if stand_at is None else joint_values(stand_at.split(), loaded.joint_names, "--stand-at")
    folder = None if out is None else prepare_folder(out)
    with progress_bar(f"{loaded.name} {job}") as progress:
        outcome = execute(
            planned,
            job,
            _kernel(kernel),
            stand_at=standing,
            cut_stream_s=cut_stream,
            driver_profile=driver_profile,
            progress=progress,
        )
    document = _document(outcome)
    pictures = folder is not None and write_folder(folder, outcome, document)
    if as_json:
        print_json(document)
    else:
        _print_report(outcome, document)
    if folder is not None:
        _say_where(folder, pictures=pictures, to_stderr=as_json)
    if outcome.fault:
        raise DeviceFaultError(_fault_line(outcome))
    if not outcome.report.passed:
        raise typer.Exit(EXIT_NOT_VERIFIED)


def _only(words: list[str]) -> str:
    if len(words) != 1:
        given = " ".join(words) or "nothing"
        raise InputError(f"one JOB or FILE is needed after the robot, not {given}")
    return words[0]


def _trajectory(robot: "Robot", job: str, options: dict[str, str]) -> "Trajectory":
    from host.jobs import make_job
    from host.trajectory_file import is_trajectory_file, read_trajectory

    if not is_trajectory_file(job):
        return make_job(robot, job, options)
    if options:
        raise InputError(f"option {next(iter(options))}: a trajectory from a file has no options")
    return read_trajectory(job, robot)


def _kernel(choice: KernelChoice) -> "Kernel":
    from controller.backend import KERNELS, fastest_kernel

    if choice is KernelChoice.AUTO:
        return fastest_kernel()
    try:
        return KERNELS[choice]()
    except ModuleNotFoundError as error:
        raise InputError("--kernel numba: numba is not installed (pip install 'steptwin[fast]')") from error


@contextmanager
def progress_bar(title: str) -> "Iterator[Progress]":
    """A bar on stderr while something long runs, if that is a terminal."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as RichProgress

    console = Console(stderr=True)
    with RichProgress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(escape(title), total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


def _document(outcome: "Outcome") -> dict[str, Any]:
    """The contract's keys, and what a fault leaves."""
    document = outcome.report.to_dict()
    document["driver_profile"] = outcome.driver_profile
    document["simulated"] = True
    if outcome.fault:
        document["passed"] = False
        document["fault"] = {
            "message": outcome.fault.message,
            "codes": {name: [f"0x{code:04X}" for code in codes] for name, codes in outcome.fault.codes.items()},
            "joints": outcome.fault.joints,
            "positions_agree": outcome.fault.positions_agree,
        }
    return document


def _fault_line(outcome: "Outcome") -> str:
    fault = outcome.fault
    assert fault is not None
    joints = ", ".join(f"{name} = {value:.4f}" for name, value in fault.joints.items())
    agree = "as the drivers counted" if fault.positions_agree else "but the drivers counted otherwise"
    return f"{fault.message}; stopped at {joints}, {agree}"


def _print_report(outcome: "Outcome", document: dict[str, Any]) -> None:
    if outcome.driver_profile != _USUAL_DRIVERS:
        typer.echo(f"drivers: {outcome.driver_profile}")
    print_table(list(_COLUMNS), [_row(axis) for axis in document["axes"]])
    moving = [axis for axis in document["axes"] if axis["pulses"]]
    if moving:
        typer.echo(f"CLK: high {_least(moving, 'clk_high_us_min')}, low {_least(moving, 'clk_low_us_min')}")
    changes = [output for output in document["outputs"] if output["changed_s"] is not None]
    if changes:
        said = (f"{o['name']} {'on' if o['on'] else 'off'} {o['changed_s']:.3f} s" for o in changes)
        typer.echo(f"outputs: {', '.join(said)}")
    _print_violations(document["violations"])
    tool, bus = document["tool"], document["bus"]
    typer.echo(
        f"tool: {tool['position_error_mm_max']:.4f} mm max, {tool['position_error_mm_rms']:.4f} mm rms, "
        f"{tool['attitude_error_deg_max']:.4f} deg max"
    )
    typer.echo(f"bus: {bus['frames']} frames at {bus['bitrate'] // 1000} kbit/s, {bus['load_percent']:.1f} % load")
    typer.echo(
        f"SIMULATED {document['simulated_s']:.2f} s in {document['wall_s']:.2f} s, "
        f"{document['simulated_s'] / document['wall_s']:.0f} x real time"
    )
    typer.echo(f"{document['robot']} {document['job']}: {_verdict(outcome)}")


def _print_violations(violations: list[dict[str, Any]]) -> None:
    """A table for each rule that was broken, with a row for each axis that broke it."""
    for what, source in dict.fromkeys((v["broken"], v["source"]) for v in violations):
        typer.echo(f"{what} ({source})")
        same = [v for v in violations if (v["broken"], v["source"]) == (what, source)]
        unit = same[0]["unit"]
        rows = [
            [v["axis"], str(v["count"]), f"{v['worst']:.2f}", f"{v['limit']:.2f}", f"{v['first_s']:.6f}"] for v in same
        ]
        print_table(["axis", "times", f"worst {unit}", f"limit {unit}", "first s"], rows)


def _say_where(folder: Path, *, pictures: bool, to_stderr: bool) -> None:
    if pictures:
        typer.echo(f"report, edges, bus log and pictures are in {folder}/", err=to_stderr)
    else:
        typer.echo(f"report, edges and bus log are in {folder}/", err=to_stderr)
        typer.echo("no pictures: matplotlib is not installed (pip install 'steptwin[plot]')", err=True)


def _verdict(outcome: "Outcome") -> str:
    if outcome.fault:
        return "STOPPED BY A FAULT"
    return "PASSED" if outcome.report.passed else "\n  ".join(["FAILED", *outcome.report.reasons])


def _least(axes: list[dict[str, Any]], key: str) -> str:
    times_us = [axis[key] for axis in axes if axis[key] is not None]
    return f"at least {min(times_us):.2f} us" if times_us else "once"


_COLUMNS = ("axis", "start", "end", "pulses", "peak Hz", "err steps", "p50 us", "p99 us", "broken")
"""Steps at start and end; largest position error in steps; timing error; pulses that broke a driver limit."""


def _row(axis: dict[str, Any]) -> list[str]:
    counts = [axis["name"], *(str(axis[key]) for key in ("steps_start", "steps_end", "pulses"))]
    if axis["mean_step_interval_us"] is None:
        return [*counts, *["-"] * 4, str(axis["violations"])]
    return [
        *counts,
        f"{axis['peak_rate_hz']:.1f}",
        f"{axis['position_error_steps_max']:.4f}",
        f"{axis['timing_error_us_p50']:.2f}",
        f"{axis['timing_error_us_p99']:.2f}",
        str(axis["violations"]),
    ]
