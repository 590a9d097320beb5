"""`steptwin run ROBOT JOB|FILE`: plan a motion, stream it to a board, verify the pulses."""

from typing import Annotated, Any

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    DipMicrosteps,
    DriverProfileName,
    LockedDrawer,
    ShelfStock,
    name_value_pairs,
)
from steptwin.host.cli.live.connection import LIVE_PANEL, SessionOptions
from steptwin.host.cli.run.chosen_motion import FileOptions, InterpolationName, choose_motion
from steptwin.host.cli.run.faults_on_purpose import Faults
from steptwin.host.cli.run.live_run import run_live
from steptwin.host.cli.run.shelf_errand import choose_errand
from steptwin.host.cli.run.virtual_run import EmulatedMachine, KernelName, run_virtual
from steptwin.host.common.choices import MotorsTurn
from steptwin.host.common.errors import InputError


@command(
    "warehouse-scara drawer-pull --out out/drawer-pull",
    "teaching-scara carry --approach --connect 127.0.0.1",
    alone={"--motors": "after"},
)
def run(
    live: SessionOptions,
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT JOB|FILE [BOX]",
            help="The robot, and one of its jobs (`steptwin jobs ROBOT` lists them), a program: TOML with steps"
            " (docs/programs.md), or a trajectory file: CSV with the header t,JOINT,... or t,x,y,z,phi, or JSON in the"
            " shape of ROS' JointTrajectory, in s, mm and degrees. With --inventory, the name of the box.",
        ),
    ] = None,
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
    units: Annotated[
        str | None,
        typer.Option(metavar="rad,m", help="Units of a file's angles, deg or rad, and of its lengths, mm or m."),
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
        KernelName,
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
        MotorsTurn | None,
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
    repeat: Annotated[
        int, typer.Option(metavar="N", help="Number of times the motion runs.", rich_help_panel=LIVE_PANEL)
    ] = 1,
    approach: Annotated[
        bool,
        typer.Option("--approach", help="Move to the start first, all joints together.", rich_help_panel=LIVE_PANEL),
    ] = False,
) -> None:
    """Run a job, a program or a trajectory file on an emulated board in virtual time and verify every pulse.

    With --connect or -i it runs on a live board instead, which must stand at the motion's start. Then the positions
    at the end are compared with the plan.
    """
    robot, rest = live.robot_and_rest(words)
    job, box = _job_and_box(rest, boxes=robot.shelf is not None)
    options = name_value_pairs(option or []) | ({"elbow": elbow} if elbow is not None else {})
    errand = choose_errand(robot, job, options, inventory, box)
    motion = choose_motion(
        robot, job, dict(errand.options), FileOptions(interpolate, ramps, units), stretch=stretch, speed=speed
    )
    machine = EmulatedMachine(
        out=out,
        stand_at=stand_at,
        cut_stream_s=cut_stream,
        driver_profile=driver_profile,
        dip_microsteps=dip_microsteps,
        kernel=kernel,
        inputs=inputs,
        stock=stock,
        locked_drawers=locked_drawer,
        faults=faults,
        motors=motors,
        crystal_ppm=crystal,
    )
    if live.address.connection(robot) is None:
        only_live = {"--repeat": repeat if repeat != 1 else None, "--approach": approach or None}
        _refuse(only_live | {"--force": live.force or None}, "a live board")
        run_virtual(robot, motion, job, errand, machine, as_json=live.as_json)
    else:
        _refuse({**machine.given, "--inventory": inventory}, "a run in virtual time, without --connect or -i")
        motion.say_summary(to_stderr=live.as_json)
        run_live(live, motion.plan, job, repeat=repeat, approach=approach)


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
