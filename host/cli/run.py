"""`steptwin run ROBOT JOB|FILE`: plan a motion, stream it to a board, verify the pulses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    LEVELS,
    AsJson,
    DipMicrosteps,
    DriverProfileName,
    LockedDrawer,
    RobotFile,
    ShelfStock,
    dip_settings,
    finite_number,
    joint_values,
    name_value_pairs,
    out_folder,
    robot_and_rest,
    warn_of_settings_left_out,
)
from steptwin.host.cli.chosen_motion import choose_motion
from steptwin.host.cli.connection import LIVE_PANEL, Bitrate, Channel, Connect, Force, Interface, connection
from steptwin.host.cli.faults_on_purpose import Faults, chosen_scenario, print_faults
from steptwin.host.cli.file_motion import InterpolationName
from steptwin.host.cli.live_run import run_live
from steptwin.host.cli.motor_report import (
    check_motors,
    keep_motors,
    motors_of,
    print_motors,
    telling_time,
    with_motors,
)
from steptwin.host.cli.option_names import naming_options
from steptwin.host.cli.output import print_json, say
from steptwin.host.cli.progress import progress_bar
from steptwin.host.cli.report import EXIT_NOT_VERIFIED, fault_line, print_report
from steptwin.host.cli.shelf_errand import choose_errand
from steptwin.host.common.errors import DeviceFaultError, InputError

if TYPE_CHECKING:
    from steptwin.host.twin.input_changes import InputChange
    from steptwin.host.twin.kernels import Kernel
    from steptwin.host.twin.outcome import Outcome


_KernelName = Literal["auto", "python", "numba", "cortex-m3"]
"""The forms of the firmware's kernel; all make the same edges."""
_Motors = Literal["after", "loop"]
"""When the motors turn: after the run, or as it goes."""


@command(
    "warehouse-scara drawer-pull --out out/drawer-pull",
    "teaching-scara carry --approach --connect 127.0.0.1",
    alone={"--motors": "after"},
)
def run(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT JOB|FILE [BOX]",
            help="The robot, and one of its jobs (`steptwin jobs ROBOT` lists them), a program: TOML with steps"
            " (docs/programs.md), or a trajectory file: CSV with the header t,JOINT,... or t,x,y,z,phi, or JSON in the"
            " shape of ROS' JointTrajectory, in s, mm and degrees. With --inventory, the name of the box.",
        ),
    ] = None,
    robot_file: RobotFile = None,
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Folder to write report, edges, bus log and pictures into.")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option("--option", "-o", metavar="NAME=VALUE", help="Set a job's option; repeatable."),
    ] = None,
    elbow: Annotated[
        str | None, typer.Option(metavar="right|left", help="Short for -o elbow=...; also for a file of poses.")
    ] = None,
    interpolate: Annotated[
        InterpolationName | None,
        typer.Option(
            metavar="spline|linear|stop",
            help="Motion between a file's points: a spline, straight lines of the joints with blends, or with stops.",
        ),
    ] = None,
    ramps: Annotated[
        str | None,
        typer.Option(metavar="SECONDS", help="Duration of a run-in and run-out for a file that is in motion there."),
    ] = None,
    stand_at: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="Where the emulated machine stands; by default at the job's start."),
    ] = None,
    cut_stream: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Time at which the host stops sending points, as if it hung."),
    ] = None,
    driver_profile: DriverProfileName = None,
    dip_microsteps: DipMicrosteps = None,
    kernel: Annotated[
        _KernelName,
        typer.Option(
            metavar="NAME",
            help="Form of the firmware's kernel: python, numba (compiled), cortex-m3 (as C on an emulated core), or"
            " auto: the fastest.",
        ),
    ] = "auto",
    inventory: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Inventory of the shelf: gives a box a free slot or finds it, and is written after a verified run.",
        ),
    ] = None,
    stock: ShelfStock = None,
    locked_drawer: LockedDrawer = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="NAME=on|off@SECONDS",
            help="Change a digital input of the emulated machine, in simulated seconds since the motion's start;"
            " repeatable.",
        ),
    ] = None,
    faults: Faults = None,
    motors: Annotated[
        _Motors | None,
        typer.Option(
            metavar="[=loop]",
            help="Turn the motors by the run, with the arm's masses: do they keep step? With =loop they turn as it"
            " goes, and the switches follow them (docs/motors.md).",
        ),
    ] = None,
    crystal: Annotated[
        int,
        typer.Option(
            metavar="PPM", help="How fast the emulated board's crystal is, from -1000 to 1000 parts per million."
        ),
    ] = 0,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    stretch: Annotated[
        str | None,
        typer.Option(
            metavar="FACTOR|auto", help="Make the motion this many times slower; auto: just as slow as it must be."
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(metavar="PERCENT", help="Speed of the motion, from 1: 50 is the same as --stretch 2."),
    ] = None,
    force: Force = False,
    repeat: Annotated[
        int, typer.Option(metavar="N", help="Number of times the motion runs.", rich_help_panel=LIVE_PANEL)
    ] = 1,
    approach: Annotated[
        bool,
        typer.Option("--approach", help="Move to the start first, all joints together.", rich_help_panel=LIVE_PANEL),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Run a job, a program or a trajectory file on an emulated board in virtual time and verify every pulse.

    With --connect or -i it runs on a live board instead, which must stand at the motion's start. Then the positions
    at the end are compared with the plan.
    """
    from steptwin.host.record.folder import FOLDER_VERSION, VERSION_KEY, keep_recording
    from steptwin.host.twin.execution import execute

    loaded, rest = robot_and_rest(words or [], robot_file)
    job, box = _job_and_box(rest, boxes=loaded.shelf is not None)
    options = name_value_pairs(option or []) | ({"elbow": elbow} if elbow is not None else {})
    errand = choose_errand(loaded, job, options, inventory, box)
    motion = choose_motion(
        loaded, job, dict(errand.options), interpolate=interpolate, ramps=ramps, stretch=stretch, speed=speed
    )
    live = connection(connect, interface, channel, bitrate, loaded)
    if live is not None:
        emulated = {
            "--out": out,
            "--stand-at": stand_at,
            "--cut-stream": cut_stream,
            "--driver-profile": driver_profile,
            "--dip-microsteps": dip_microsteps or None,
            "--kernel": None if kernel == "auto" else kernel,
            "--input": inputs or None,
            "--inventory": inventory,
            "--stock": stock or None,
            "--locked-drawer": locked_drawer or None,
            "--faults": faults,
            "--motors": motors,
            "--crystal": crystal or None,
        }
        _refuse(emulated, "a run in virtual time, without --connect or -i")
        motion.say_summary(to_stderr=as_json)
        run_live(live, motion.plan, job, repeat=repeat, approach=approach, force=force, as_json=as_json)
        return
    _refuse(
        {"--repeat": repeat if repeat != 1 else None, "--approach": approach or None, "--force": force or None},
        "a live board",
    )
    warn_of_settings_left_out(loaded, driver_profile)
    if motors:
        check_motors(loaded)
    standing = None if stand_at is None else joint_values(stand_at.split(), loaded.joint_names, "--stand-at")
    if out is not None:
        with naming_options("out"):
            keep_recording(out)
    folder = out_folder(out)
    scenario = chosen_scenario(faults, loaded)
    motion.say_summary(to_stderr=as_json)
    with (
        progress_bar(f"{loaded.name} {job}") as progress,
        naming_options(
            *("dip_microsteps", "stock"),
            cut_stream_s="--cut-stream",
            locked_drawers="--locked-drawer",
            crystal_ppm="--crystal",
        ),
    ):
        outcome = execute(
            motion.plan,
            job,
            _kernel(kernel),
            stand_at=standing,
            cut_stream_s=cut_stream,
            driver_profile=driver_profile,
            dip_microsteps=dip_settings(dip_microsteps),
            inputs=[_input_change(text) for text in inputs or ()],
            errand=errand.errand,
            stock=name_value_pairs(stock) if stock else None,
            locked_drawers=locked_drawer or (),
            scenario=scenario,
            motors=motors == "loop",
            crystal_ppm=crystal,
            progress=telling_time(progress, "run") if motors == "loop" else progress,
        )
    document = outcome.to_dict() | ({} if folder is None else {VERSION_KEY: FOLDER_VERSION})
    pictures = folder is not None and outcome.save(folder)
    ran = motors_of(motion.plan.robot, outcome.comparison, trace=outcome.rotors) if motors else None
    verdict = None if ran is None else ran.verdict
    if ran is not None and folder is not None:
        keep_motors(folder, ran, outcome.report.run, pictures=pictures)
    if as_json:
        print_json(document if verdict is None else with_motors(document, verdict))
    else:
        print_report(document)
        print_faults(document)
        if verdict is not None:
            print_motors(verdict)
    if folder is not None:
        _say_where(folder, pictures=pictures, to_stderr=as_json)
    _raise_unless_right(outcome, kept_step=verdict is None or verdict.kept_step)
    if outcome.passed:
        errand.keep(loaded, to_stderr=as_json)


def _raise_unless_right(outcome: "Outcome", *, kept_step: bool) -> None:
    """End the command unless the run is right: with a scenario, if it went as documented, even if the motion did not.

    Raises:
        DeviceFaultError: a fault has ended a run without a scenario.
        Exit: the run is not verified, the scenario has failed, or a motor has lost its step.
    """
    if outcome.scenario is not None:
        right = outcome.scenario.passed
    elif outcome.fault:
        raise DeviceFaultError(fault_line(outcome.fault.to_dict()))
    else:
        right = outcome.report.passed
    if not (right and kept_step):
        raise typer.Exit(EXIT_NOT_VERIFIED)


def _input_change(text: str) -> "InputChange":
    """Return the change of an input that an --input names."""
    from steptwin.host.twin.input_changes import InputChange

    name, _, rest = text.partition("=")
    level, at, seconds = rest.partition("@")
    if not (name and at) or level not in LEVELS:
        raise InputError(f"--input {text}: is not NAME=on@SECONDS or NAME=off@SECONDS")
    at_s = finite_number(seconds, f"--input {text}")
    if at_s < 0:
        raise InputError(f"--input {text}: {at_s:g} s is before the motion's start")
    return InputChange(name, LEVELS[level], at_s)


def _refuse(options: dict[str, Any], other: str) -> None:
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(f"{given[0]}: is for {other}")


def _job_and_box(words: list[str], *, boxes: bool) -> tuple[str, str | None]:
    """Return the job or file, and the box if the robot has a shelf and a word follows."""
    if len(words) not in ((1, 2) if boxes else (1,)):
        given = " ".join(words) or "nothing"
        raise InputError(f"one JOB or FILE is needed after the robot, not {given}")
    return words[0], words[1] if len(words) > 1 else None


def _kernel(choice: _KernelName) -> "Kernel":
    from steptwin.host.twin.kernels import fastest_kernel, kernel_named

    return fastest_kernel() if choice == "auto" else kernel_named(choice)


def _say_where(folder: Path, *, pictures: bool, to_stderr: bool) -> None:
    if pictures:
        say(f"report, edges, bus log and pictures are in {folder}/", err=to_stderr)
    else:
        say(f"report, edges and bus log are in {folder}/", err=to_stderr)
        say("no pictures: matplotlib is not installed (pip install 'steptwin[plot]')", err=True)
