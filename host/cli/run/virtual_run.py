"""Run a motion on an emulated board in virtual time: `steptwin run` without --connect or -i."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from steptwin.host.cli.arguments import finite_number, joint_values, run_folder
from steptwin.host.cli.output import print_json, say
from steptwin.host.cli.progress import progress_bar
from steptwin.host.cli.run.chosen_motion import ChosenMotion
from steptwin.host.cli.run.emulated_machine import machine_keywords, naming_machine_options
from steptwin.host.cli.run.faults_on_purpose import print_faults, telling_of_faults
from steptwin.host.cli.run.motor_report import (
    check_motors,
    keep_motors,
    motors_of,
    print_motors,
    telling_time,
    with_motors,
)
from steptwin.host.cli.run.shelf_errand import ShelfErrand
from steptwin.host.cli.run.verdict_text import EXIT_NOT_VERIFIED, fault_line, print_report
from steptwin.host.common.choices import LEVELS, MotorsTurn
from steptwin.host.common.errors import DeviceFaultError, InputError

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.outcome import Outcome
    from steptwin.host.twin.machine.input_changes import InputChange
    from steptwin.host.twin.machine.kernels import Kernel
    from steptwin.host.twin.machine.machine_options import MachineKeywords
    from steptwin.host.twin.motors import MotorVerdict

KernelName = Literal["auto", "python", "numba", "cortex-m3"]
"""The forms of the firmware's kernel; all make the same edges."""


@dataclass(frozen=True, slots=True)
class EmulatedMachine:
    """The options of `steptwin run` that concern the emulated machine and the record of what it does, as given.

    Attributes:
        out: folder for all files.
        stand_at: where the machine stands, joint by joint.
        cut_stream_s: time at which the host stops sending points.
        driver_profile: drivers instead of the robot file's.
        dip_microsteps: microsteps set by the drivers' switches, as JOINT=N.
        kernel: form of the firmware's kernel.
        inputs: changes of digital inputs, as NAME=on@SECONDS.
        stock: boxes of the shelf, as PLACE=BOX.
        locked_drawers: slots whose drawers are locked.
        faults: file of a scenario.
        motors: when the motors turn; None: they do not.
        crystal_ppm: how fast the board's crystal is.
    """

    out: str | None
    stand_at: str | None
    cut_stream_s: float | None
    driver_profile: str | None
    dip_microsteps: list[str] | None
    kernel: KernelName
    inputs: list[str] | None
    stock: list[str] | None
    locked_drawers: list[str] | None
    faults: str | None
    motors: MotorsTurn | None
    crystal_ppm: int

    @property
    def given(self) -> Mapping[str, Any]:
        """The value of each option by its name on the command line; None for one that was not given."""
        return {
            "--out": self.out,
            "--stand-at": self.stand_at,
            "--cut-stream": self.cut_stream_s,
            "--driver-profile": self.driver_profile,
            "--dip-microsteps": self.dip_microsteps or None,
            "--kernel": None if self.kernel == "auto" else self.kernel,
            "--input": self.inputs or None,
            "--stock": self.stock or None,
            "--locked-drawer": self.locked_drawers or None,
            "--faults": self.faults,
            "--motors": self.motors,
            "--crystal": self.crystal_ppm or None,
        }

    def keywords(self, robot: "Robot") -> "MachineKeywords":
        """Return how the machine differs from the robot's file, read; raises as `machine_keywords`."""
        return machine_keywords(
            robot,
            driver_profile=self.driver_profile,
            dip_microsteps=self.dip_microsteps,
            stock=self.stock,
            locked_drawers=self.locked_drawers,
            faults=self.faults,
            motors=self.motors is MotorsTurn.IN_LOOP,
            crystal=self.crystal_ppm,
        )


def run_virtual(
    robot: "Robot", motion: ChosenMotion, job: str, errand: ShelfErrand, machine: EmulatedMachine, *, as_json: bool
) -> None:
    """Run a motion, tell what it did, and keep it where that is asked for.

    Raises:
        DeviceFaultError: a fault has ended a run without a scenario.
        Exit: the run is not verified, the scenario has failed, or a motor has lost its step.
    """
    if machine.motors:
        check_motors(robot)
    outcome, folder = _executed(robot, motion, job, errand, machine, as_json=as_json)
    verdict = _told(outcome, folder, machine, as_json=as_json)
    _raise_unless_right(outcome, kept_step=verdict is None or verdict.kept_step)
    if outcome.passed:
        errand.keep(robot, to_stderr=as_json)


def _executed(
    robot: "Robot", motion: ChosenMotion, job: str, errand: ShelfErrand, machine: EmulatedMachine, *, as_json: bool
) -> "tuple[Outcome, Path | None]":
    """Check everything that is asked for before anything runs; return what the run did, and the folder to keep it."""
    from steptwin.host.twin.embedded.execution import execute

    stand_at = machine.stand_at
    standing = None if stand_at is None else joint_values(stand_at.split(), robot.joint_names, "--stand-at")
    folder = run_folder(machine.out)
    options = machine.keywords(robot)
    motion.say_summary(to_stderr=as_json)
    with (
        progress_bar(f"{robot.name} {job}") as progress,
        naming_machine_options(cut_stream_s="--cut-stream"),
        telling_of_faults(as_json=as_json),
    ):
        outcome = execute(
            motion.plan,
            job,
            _kernel(machine.kernel),
            stand_at=standing,
            cut_stream_s=machine.cut_stream_s,
            inputs=[_input_change(text) for text in machine.inputs or ()],
            errand=errand.errand,
            progress=telling_time(progress, "run") if machine.motors is MotorsTurn.IN_LOOP else progress,
            **options,
        )
    return outcome, folder


def _told(outcome: "Outcome", folder: Path | None, machine: EmulatedMachine, *, as_json: bool) -> "MotorVerdict | None":
    """Write the folder and print the report; return the verdict on the motors, None if they have not turned."""
    from steptwin.host.record.folder import FOLDER_VERSION, VERSION_KEY

    document = outcome.to_dict() | ({} if folder is None else {VERSION_KEY: FOLDER_VERSION})
    pictures = folder is not None and outcome.save(folder)
    ran = motors_of(outcome.plan.robot, outcome.comparison, trace=outcome.rotors) if machine.motors else None
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
    return verdict


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
    from steptwin.host.twin.machine.input_changes import InputChange

    name, _, rest = text.partition("=")
    level, at, seconds = rest.partition("@")
    if not (name and at) or level not in LEVELS:
        raise InputError(f"--input {text}: is not NAME=on@SECONDS or NAME=off@SECONDS")
    at_s = finite_number(seconds, f"--input {text}")
    if at_s < 0:
        raise InputError(f"--input {text}: {at_s:g} s is before the motion's start")
    return InputChange(name, LEVELS[level], at_s)


def _kernel(choice: KernelName) -> "Kernel":
    from steptwin.host.twin.machine.kernels import fastest_kernel, kernel_named

    return fastest_kernel() if choice == "auto" else kernel_named(choice)


def _say_where(folder: Path, *, pictures: bool, to_stderr: bool) -> None:
    if pictures:
        say(f"report, edges, bus log and pictures are in {folder}/", err=to_stderr)
    else:
        say(f"report, edges and bus log are in {folder}/", err=to_stderr)
        say("no pictures: matplotlib is not installed (pip install 'steptwin[plot]')", err=True)
