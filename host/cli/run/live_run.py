"""Run a job or a trajectory file on a live board: `steptwin run` with --connect or -i."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from steptwin.host.cli.app import end_unless
from steptwin.host.cli.live.connection import SessionOptions, live_option, live_switch
from steptwin.host.cli.options import given_options, naming_options
from steptwin.host.cli.output import fixed, print_table, progress_bar, say
from steptwin.host.cli.run.chosen_motion import ChosenMotion
from steptwin.host.cli.run.verdict_text import print_waits
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.running import LiveOutcome


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRunOptions(SessionOptions):
    """The options of a run that a live board may make."""

    repeat: int = live_option("N", "Number of times the motion runs.", default=1)
    approach: bool = live_switch("Move to the start first, all joints together.")

    def refuse(self) -> None:
        """Raise InputError for an option that is given, without a live board."""
        for name in ("--repeat", "--approach", "--force"):
            if name in given_options(self):
                raise InputError(f"{name}: is for a live board")


def run_live(live: LiveRunOptions, motion: ChosenMotion) -> None:
    """Run a motion on a live board and print how it ended; raises as `execute_live` does."""
    from steptwin.host.operate.running import check_repeatable, execute_live

    plan, job = motion.plan, motion.job
    with naming_options("repeat"):
        check_repeatable(plan, live.repeat)
    with (
        live.session(plan.robot) as session,
        progress_bar(f"{plan.robot.name} {job}") as progress,
        naming_options("approach"),
    ):
        outcome = execute_live(session, plan, job, repeat=live.repeat, approach=live.approach, progress=progress)
    live.tell(outcome.to_dict(), lambda: _print(outcome))
    end_unless(outcome.passed)


def _print(outcome: "LiveOutcome") -> None:
    joints = outcome.plan.robot.joints
    rows = [
        [axis.name, joint.unit, fixed(position), f"{axis.error_steps:.4f}"]
        for axis, joint, position in zip(outcome.axes, joints, outcome.end, strict=True)
    ]
    print_table(["axis", "unit", "end", "err steps"], rows, text_columns=2)
    print_waits(outcome.to_dict())
    times = "" if outcome.repetitions == 1 else f", {outcome.repetitions} times"
    verdict = "ended where planned" if outcome.passed else "ENDED ELSEWHERE"
    say(f"{outcome.plan.robot.name} {outcome.job}{times}: {verdict}")
