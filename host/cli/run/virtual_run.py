"""Run a motion on an emulated board in virtual time: `steptwin run` without --connect or -i."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from steptwin.host.cli.app import end_unless
from steptwin.host.cli.arguments import AnswerOptions, finite_number, machine_for, naming_machine_options, run_folder
from steptwin.host.cli.options import Without, given_options, of_features, option
from steptwin.host.cli.output import progress_bar, say, say_compiling
from steptwin.host.cli.run.chosen_motion import ChosenMotion
from steptwin.host.cli.run.hooks import Added, PreparedRun, RunHook, telling_unbegun, tellings
from steptwin.host.cli.run.verdict_text import fault_line, print_report
from steptwin.host.common.choices import LEVELS
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.common.extras import installing
from steptwin.host.twin.machine.machine_options import MachineOptions, merged

if TYPE_CHECKING:
    from steptwin.host.client import Progress
    from steptwin.host.planning.plan import Plan
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.outcome import Outcome
    from steptwin.host.twin.machine.input_changes import InputChange
    from steptwin.host.twin.machine.kernels import Kernel


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualRunOptions:
    """Options of a run in virtual time: emulated machine, events of the run, and files."""

    out: str | None = option("DIR", "Folder to write report, edges, bus log and pictures into.")
    hooks: Sequence[RunHook] = of_features("run_options")
    cut_stream: float | None = option("SECONDS", "Time from which on the host sends no points, as if it hung.")
    inputs: list[str] | None = option(
        "NAME=on|off@SECONDS",
        "Change a digital input of the emulated machine, in simulated seconds since the motion's start; repeatable.",
        "--input",
    )
    kernel: str = option(
        "NAME",
        "Form of the firmware's kernel, such as python or numba (compiled), or auto: the one that ends soonest.",
        default="auto",
    )
    machine: Annotated[MachineOptions, Without(())]

    def refuse(self) -> None:
        """Raise InputError for an option that is given with a live board."""
        for name in given_options(self):
            raise InputError(f"{name}: is for a run in virtual time, without --connect or -i")

    def machine_for(self, robot: "Robot", extras: Sequence[Any]) -> MachineOptions:
        """Return the machine's options with those of features; raise as `machine_for`."""
        return machine_for(robot, replace(self.machine, extras=merged(self.machine.extras, extras)))

    @property
    def loads_numba(self) -> bool:
        """True if a feature loads numba in any case, if it is installed."""
        return any(hook.loads_numba for hook in self.hooks)


def run_virtual(answer: AnswerOptions, motion: ChosenMotion, prepared: PreparedRun, options: VirtualRunOptions) -> None:
    """Run a motion, print the result, and store it if requested.

    Raises:
        DeviceFaultError: a fault has ended the run, without a feature's verdict.
        Exit: the run is not verified, or a feature has a failed verdict or a later reason.
    """
    from steptwin.host.record.folder import FOLDER_VERSION, VERSION_KEY

    outcome, folder = _executed(answer, motion, prepared, options)
    done = FinishedRun.of(outcome, options.hooks)
    pictures = folder is not None and done.save(folder)
    version = {} if folder is None else {VERSION_KEY: FOLDER_VERSION}
    answer.tell(done.document() | version, done.print)
    if folder is not None:
        what = "report, edges, bus log and pictures" if pictures else "report, edges and bus log"
        answer.add_files(f"{what} are", folder, pictures=pictures)
    outcome = done.outcome
    if outcome.fault and not outcome.verdicts:
        raise DeviceFaultError(fault_line(outcome.fault.to_dict()))
    end_unless(outcome.right and not outcome.late_reasons)  # right by the verdicts of features, if there are any
    if outcome.passed:
        for line in prepared.finish(motion.plan.robot):
            answer.add(line)


def _executed(
    answer: AnswerOptions, motion: ChosenMotion, prepared: PreparedRun, options: VirtualRunOptions
) -> "tuple[Outcome, Path | None]":
    """Check all options before the run; return its outcome, and the folder to store it."""
    from steptwin.host.twin.embedded.execution import execute
    from steptwin.host.twin.machine.kernels import soonest_is_compiled, telling_of_compiling

    robot = motion.plan.robot
    folder = None if options.out is None else run_folder(options.out)
    machine = options.machine_for(robot, prepared.extras)
    motion.print_summary(answer)
    compiled = options.kernel == "numba" or options.loads_numba or soonest_is_compiled(motion.plan)
    with (
        telling_of_compiling(say_compiling, wanted=compiled and options.kernel in ("auto", "numba")),
        progress_bar(f"{robot.name} {motion.job}") as bar,
        naming_machine_options(cut_stream_s="--cut-stream"),
        telling_unbegun(answer),
    ):
        progress: Progress = bar
        for hook in options.hooks:
            progress = hook.watching(progress)
        outcome = execute(
            motion.plan,
            motion.job,
            _kernel(options, motion.plan),
            cut_stream_s=options.cut_stream,
            inputs=[_input_change(text) for text in options.inputs or ()],
            progress=progress,
            **machine.keywords,
        )
    return outcome, folder


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A run with the additions of features.

    Attributes:
        outcome: the run.
        added: additions of features.
    """

    outcome: "Outcome"
    added: Sequence[Added]

    @classmethod
    def of(cls, outcome: "Outcome", hooks: Iterable[RunHook]) -> "FinishedRun":
        """Let features examine a run."""
        added = list[Added]()
        for hook in hooks:
            if more := hook.add(outcome):
                outcome = more.outcome
                added.append(more)
        return cls(outcome, added)

    def save(self, folder: Path) -> bool:
        """Write the folder of the run; return whether there are pictures."""
        pictures = self.outcome.save(folder)
        for each in self.added:
            each.save(folder, pictures)
        return pictures

    def document(self) -> dict[str, Any]:
        """Return the document of --json."""
        return self.outcome.to_dict()

    def print(self) -> None:
        """Print the report, the texts of features, and their additions."""
        document = self.outcome.to_dict()
        for each in self.added:
            if each.answer:
                say(each.answer)
        print_report(document)
        for telling in tellings():
            telling.print_run(document)
        for each in self.added:
            each.print()
        print_missing_extra(document["wall_s"])


_LONG_S: Final = 3.0
"""Duration of a run below which numba would save little."""


def print_missing_extra(wall_s: float) -> None:
    """Print on stderr, after a long run, the missing extra that would make it faster."""
    if wall_s > _LONG_S and not find_spec("numba"):
        say(f"numba makes long runs about twice as fast ({installing('fast')})", err=True)


def _input_change(text: str) -> "InputChange":
    """Return the change of an input from an --input option."""
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
    return fastest_kernel() if options.loads_numba else soonest_kernel(plan)
