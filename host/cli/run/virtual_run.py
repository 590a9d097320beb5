"""Run a motion on an emulated board in virtual time: `steptwin run` without --connect or -i."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from steptwin.features.motors.report import check_motors, keep_motors, motors_of, print_motors, telling_time
from steptwin.host.cli.app import end_unless
from steptwin.host.cli.arguments import AnswerOptions, finite_number, machine_for, naming_machine_options, run_folder
from steptwin.host.cli.options import MACHINE_PANEL, Without, given_options, of_features, option
from steptwin.host.cli.output import progress_bar, say, say_compiling
from steptwin.host.cli.run.chosen_motion import ChosenMotion
from steptwin.host.cli.run.hooks import PreparedRun, RunHook, telling_unbegun, tellings
from steptwin.host.cli.run.verdict_text import fault_line, print_report
from steptwin.host.common.choices import LEVELS, MotorsTurn
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.common.extras import installing
from steptwin.host.twin.machine.machine_options import MachineOptions, merged

if TYPE_CHECKING:
    from steptwin.features.motors.turning import MotorRun
    from steptwin.host.planning.plan import Plan
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.outcome import Outcome
    from steptwin.host.twin.machine.input_changes import InputChange
    from steptwin.host.twin.machine.kernels import Kernel


KernelName = Literal["auto", "python", "numba", "cortex-m3"]
"""The forms of the firmware's kernel; all make the same edges."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualRunOptions:
    """The options of a run in virtual time: the emulated machine, what happens in the run, what is kept of it."""

    out: str | None = option("DIR", "Folder to write report, edges, bus log and pictures into.")
    hooks: Sequence[RunHook] = of_features("run_options")
    cut_stream: float | None = option("SECONDS", "Time from which on the host sends no points, as if it hung.")
    inputs: list[str] | None = option(
        "NAME=on|off@SECONDS",
        "Change a digital input of the emulated machine, in simulated seconds since the motion's start; repeatable.",
        "--input",
    )
    kernel: KernelName = option(
        "NAME",
        "Form of the firmware's kernel: python, numba (compiled), cortex-m3 (as C on an emulated core), or auto: the"
        " one that ends soonest.",
        default="auto",
    )
    motors: MotorsTurn | None = option(
        "[=loop]",
        "Turn the motors by the run, with the arm's masses: do they keep step? With =loop they turn as it goes, and"
        " the switches follow them (docs/motors.md).",
        rich_help_panel=MACHINE_PANEL,
    )
    machine: Annotated[MachineOptions, Without(("motors", "bitrate", "firmware", "nodes"))]

    def refuse(self) -> None:
        """Raise InputError for an option that is given, with a live board."""
        for name in given_options(self):
            raise InputError(f"{name}: is for a run in virtual time, without --connect or -i")

    def machine_for(self, robot: "Robot", extras: Sequence[Any]) -> MachineOptions:
        """Return the machine's options, read, over those that features have prepared; raises as `machine_for`."""
        options = replace(self.machine, motors=self.motors is MotorsTurn.IN_LOOP)
        return machine_for(robot, replace(options, extras=merged(options.extras, extras)))


def run_virtual(answer: AnswerOptions, motion: ChosenMotion, prepared: PreparedRun, options: VirtualRunOptions) -> None:
    """Run a motion, tell what it did, and keep it where that is asked for.

    Raises:
        DeviceFaultError: a fault has ended a run of which no feature has a verdict.
        Exit: the run is not verified, a feature's verdict is that it failed, or a motor has lost its step.
    """
    from steptwin.host.record.folder import FOLDER_VERSION, VERSION_KEY
    from steptwin.host.record.folder.writing import can_draw, draw_here, drawing_apart

    if options.motors:
        check_motors(motion.plan.robot)
    with drawing_apart() if options.out and can_draw() else nullcontext(draw_here) as draw:
        outcome, folder = _executed(answer, motion, prepared, options)
        done = FinishedRun.of(outcome, turning=options.motors is not None)
        pictures = folder is not None and done.save(folder, draw)
    version = {} if folder is None else {VERSION_KEY: FOLDER_VERSION}
    answer.tell(done.document() | version, done.print)
    if folder is not None:
        what = "report, edges, bus log and pictures" if pictures else "report, edges and bus log"
        answer.add_files(f"{what} are", folder, pictures=pictures)
    _raise_unless_right(done.outcome)
    if done.outcome.passed:
        for line in prepared.finish(motion.plan.robot):
            answer.add(line)


def _executed(
    answer: AnswerOptions, motion: ChosenMotion, prepared: PreparedRun, options: VirtualRunOptions
) -> "tuple[Outcome, Path | None]":
    """Check everything that is asked for before anything runs; return what the run did, and the folder to keep it."""
    from steptwin.host.twin.embedded.execution import execute
    from steptwin.host.twin.machine.kernels import soonest_is_compiled, telling_of_compiling

    robot = motion.plan.robot
    folder = None if options.out is None else run_folder(options.out)
    machine = options.machine_for(robot, prepared.extras)
    motion.say_summary(answer)
    compiled = options.kernel == "numba" or bool(options.motors) or soonest_is_compiled(motion.plan)
    with (
        telling_of_compiling(say_compiling, wanted=compiled and options.kernel in ("auto", "numba")),
        progress_bar(f"{robot.name} {motion.job}") as progress,
        naming_machine_options(cut_stream_s="--cut-stream"),
        telling_unbegun(answer),
    ):
        outcome = execute(
            motion.plan,
            motion.job,
            _kernel(options, motion.plan),
            cut_stream_s=options.cut_stream,
            inputs=[_input_change(text) for text in options.inputs or ()],
            progress=telling_time(progress, "run") if machine.motors else progress,
            **machine.keywords,
        )
    return outcome, folder


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A run whose motors have turned too, if they were to.

    Attributes:
        outcome: the run.
        motors: what the motors did; None if they did not turn.
    """

    outcome: "Outcome"
    motors: "MotorRun | None"

    @classmethod
    def of(cls, outcome: "Outcome", *, turning: bool) -> "FinishedRun":
        """Turn the motors by the run's record, unless they have turned with it or are not to."""
        if not turning:
            return cls(outcome, None)
        motors = motors_of(outcome.plan.robot, outcome.comparison, outcome.driver_profile, trace=outcome.rotors)
        return cls(replace(outcome, rotors=motors.trace), motors)

    def save(self, folder: Path, draw: Callable[[Path], None]) -> bool:
        """Write the folder of the run, its pictures by `draw`; return whether there are pictures."""
        pictures = self.outcome.save(folder, draw)
        if self.motors is not None:
            keep_motors(folder, self.motors, self.outcome.report.run, pictures=pictures)
        return pictures

    def document(self) -> dict[str, Any]:
        """Return the document that --json prints."""
        document = self.outcome.to_dict()
        return document if self.motors is None else document | {"motors": self.motors.verdict.to_dict()}

    def print(self) -> None:
        """Print the report, what features say of the run, and what the motors did."""
        document = self.outcome.to_dict()
        print_report(document)
        for each in tellings():
            each.print_run(document)
        if self.motors is not None:
            print_motors(self.motors.verdict)
        say_what_is_faster(document["wall_s"])


_LONG_S: Final = 3.0
"""Time of a run below which numba would win little."""


def say_what_is_faster(wall_s: float) -> None:
    """Print on stderr, after a run that took long, which extra would make it faster, if that is not installed."""
    if wall_s > _LONG_S and not find_spec("numba"):
        say(f"numba makes long runs about twice as fast ({installing('fast')})", err=True)


def _raise_unless_right(outcome: "Outcome") -> None:
    """End the command unless the run is right; where features have a verdict, by this, even if the motion has ended.

    Raises:
        DeviceFaultError: a fault has ended a run of which no feature has a verdict.
        Exit: the run is not verified, a feature's verdict is that it failed, or a motor has lost its step.
    """
    if outcome.fault and not outcome.verdicts:
        raise DeviceFaultError(fault_line(outcome.fault.to_dict()))
    end_unless(outcome.right and not outcome.slips)


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


def _kernel(options: VirtualRunOptions, plan: "Plan") -> "Kernel":
    from steptwin.host.twin.machine.kernels import fastest_kernel, kernel_named, soonest_kernel

    if options.kernel != "auto":
        return kernel_named(options.kernel)
    return fastest_kernel() if options.motors else soonest_kernel(plan)  # motors load numba in any case
