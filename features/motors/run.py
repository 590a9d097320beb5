"""Option of `steptwin run` that turns the motors, during the run or by its record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from steptwin.features.motors import NAME
from steptwin.features.motors.options import MotorOptions, MotorsTurn
from steptwin.host.cli.options import MACHINE_PANEL, option
from steptwin.host.cli.run.hooks import Added, Prepared, RunHook

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.host.client import Progress
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.outcome import Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorRunHook(RunHook):
    """When the motors of a run turn; None: they do not."""

    motors: MotorsTurn | None = option(
        "[=loop]",
        "Turn the motors by the run, with the arm's masses: do they keep step? With =loop they turn as it goes, and"
        " the switches follow them (docs/motors.md).",
        alone=MotorsTurn.AFTER,
        rich_help_panel=MACHINE_PANEL,
    )

    @property
    def loads_numba(self) -> bool:
        """True if the motors turn."""
        return self.motors is not None

    def prepare(self, robot: "Robot", _job: str, options: Mapping[str, str], _words: Sequence[str]) -> Prepared:
        """Raise InputError if the robot's file does not describe motors and masses."""
        if self.motors is None:
            return Prepared(options)
        from steptwin.features.motors.report import check_motors

        check_motors(robot)
        return Prepared(options, MotorOptions(motors=self.motors is MotorsTurn.IN_LOOP))

    def watching(self, progress: "Progress") -> "Progress":
        """Announce the duration of a run with motors in the loop."""
        if self.motors is not MotorsTurn.IN_LOOP:
            return progress
        from steptwin.features.motors.report import telling_time

        return telling_time(progress, "run")

    def add(self, outcome: "Outcome") -> Added | None:
        """Judge the motors of a run; turn them by its record, unless they have turned with it."""
        if self.motors is None:
            return None
        from steptwin.features.motors.evidence import RotorsOfRun, trace_of
        from steptwin.features.motors.report import keep_drawn, motors_of, print_motors

        robot, comparison = outcome.plan.robot, outcome.comparison
        ran = motors_of(robot, comparison, outcome.driver_profile, trace=trace_of(comparison.evidence))
        seen = RotorsOfRun(robot, ran.trace, ran.verdict)

        def save(folder: "Path", pictures: bool) -> None:
            keep_drawn(folder, ran, outcome.report.run, pictures=pictures)

        return Added(
            outcome.with_feature(NAME, seen),
            lambda: print_motors(ran.verdict),
            save,
            f"{robot.name}: {ran.verdict.answer}",
        )
