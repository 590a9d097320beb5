"""Run a job or a trajectory file on a live board: `steptwin run` with --connect or -i."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

import typer

from steptwin.host.cli.arguments import naming_options
from steptwin.host.cli.live.connection import LIVE_PANEL, NOT_CONNECTED, SessionOptions
from steptwin.host.cli.output import fixed, print_table, progress_bar, say, tell
from steptwin.host.cli.run.verdict_text import print_waits
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.running import LiveOutcome
    from steptwin.host.planning.plan import Plan

EXIT_ELSEWHERE = 1
"""Exit code of a run that did not end where the plan ends; the same as of a run that is not verified."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRunOptions(SessionOptions):
    """The options of a run that a live board may make."""

    repeat: Annotated[
        int, typer.Option(metavar="N", help="Number of times the motion runs.", rich_help_panel=LIVE_PANEL)
    ] = 1
    approach: Annotated[
        bool,
        typer.Option("--approach", help="Move to the start first, all joints together.", rich_help_panel=LIVE_PANEL),
    ] = False

    def refuse(self) -> None:
        """Raise InputError for an option that is given, without a live board."""
        for option in ("repeat", "approach", "force"):
            if getattr(self, option) != getattr(_USUAL, option):
                raise InputError(f"--{option}: is for a live board")


_USUAL: Final = LiveRunOptions(address=NOT_CONNECTED)


def run_live(live: LiveRunOptions, plan: "Plan", job: str) -> None:
    """Run a plan on a live board and print how it ended; raises as `execute_live` does."""
    from steptwin.host.operate.running import check_repeatable, execute_live

    with naming_options("repeat"):
        check_repeatable(plan, live.repeat)
    with (
        live.session(plan.robot) as session,
        progress_bar(f"{plan.robot.name} {job}") as progress,
        naming_options("approach"),
    ):
        outcome = execute_live(
            session,
            plan,
            job,
            repeat=live.repeat,
            approach=live.approach,
            progress=progress,
        )
    tell(outcome.to_dict(), lambda: _print(outcome), as_json=live.as_json)
    if not outcome.passed:
        raise typer.Exit(EXIT_ELSEWHERE)


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
