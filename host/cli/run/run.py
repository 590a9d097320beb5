"""`steptwin run ROBOT JOB|FILE`: plan a motion, stream it to a board, verify the pulses."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import PlanningOptions
from steptwin.host.cli.live.connection import SessionOptions, live_option, live_switch
from steptwin.host.cli.options import argument, given_options, naming_options
from steptwin.host.cli.output import fixed, print_table, progress_bar, say
from steptwin.host.cli.run.chosen_motion import ChosenMotion, MotionOptions, choose_motion
from steptwin.host.cli.run.hooks import prepare_run
from steptwin.host.cli.run.verdict_text import print_waits
from steptwin.host.cli.run.virtual_run import VirtualRunOptions, run_virtual
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.running import LiveOutcome
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRunOptions(SessionOptions):
    """Options of a run that also apply to a live board."""

    repeat: int = live_option("N", "Number of times the motion runs.", default=1)
    approach: bool = live_switch("Move to the start first, all joints together.")

    def refuse(self) -> None:
        """Raise InputError for an option that is given without a live board."""
        for name in ("--repeat", "--approach", "--force"):
            if name in given_options(self):
                raise InputError(f"{name}: is for a live board")


@command(
    "ar4-mk3 pick.toml --out out/pick",
    "docs/programs/turntable.toml --approach --connect 127.0.0.1",
)
def run(
    options: MotionOptions,
    planning: PlanningOptions,
    virtual: VirtualRunOptions,
    live: LiveRunOptions,
    words: list[str] | None = argument(
        "ROBOT JOB|FILE",
        "The robot, and one of its jobs (`steptwin jobs ROBOT` lists them), a program: TOML with steps"
        " (docs/programs.md), or a trajectory file: CSV with the header t,JOINT,... or t,x,y,z,phi, or JSON or YAML in"
        " the shape of ROS' JointTrajectory, in s, mm and degrees. A program that names its robot may stand alone.",
    ),
) -> None:
    """Run a job, a program or a trajectory file on an emulated board in virtual time and verify every pulse.

    With --connect or -i it runs on a live board instead, which must stand at the motion's start. Then the positions
    at the end are compared with the plan.
    """
    robot, rest = _robot_and_rest(live, words)
    prepared = prepare_run(virtual.hooks, robot, rest, options.of_job())
    with planning.bounded():
        motion = choose_motion(robot, prepared.job, prepared.options, options)
    if live.address.connection(robot) is None:
        live.refuse()
        run_virtual(live, motion, prepared, virtual)
    else:
        virtual.refuse()
        motion.print_summary(live)
        run_live(live, motion)


def _robot_and_rest(live: LiveRunOptions, words: list[str] | None) -> "tuple[Robot, list[str]]":
    """Return the robot and the remaining words; a program may name its robot itself."""
    from steptwin.host.planning.programs import SUFFIX, read_program
    from steptwin.host.planning.programs.program import load_own_robot

    first = words[0] if words and len(words) == 1 else ""
    if live.robot_file is not None or not first.endswith(SUFFIX) or not Path(first).is_file():
        return live.robot_and_rest(words)
    program = read_program(first)
    if program.robot is None:
        raise InputError(f"{first}: names no robot: write it as `robot` in the file, or before the file")
    with prefixed(f"{first}: "):
        return load_own_robot(program), words or []


def run_live(live: LiveRunOptions, motion: ChosenMotion) -> None:
    """Run a motion on a live board and print its end; raise as `execute_live`."""
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
    robot = outcome.plan.robot
    rows = [
        [axis.name, described.unit, fixed(outcome.end[robot.coupling.joint_of(i)]), f"{axis.error_steps:.4f}"]
        for i, (axis, described) in enumerate(zip(outcome.axes, robot.axes, strict=True))
    ]
    print_table(["axis", "unit", "end", "err steps"], rows, text_columns=2)
    print_waits(outcome.to_dict())
    times = "" if outcome.repetitions == 1 else f", {outcome.repetitions} times"
    verdict = "ended where planned" if outcome.passed else "ENDED ELSEWHERE"
    say(f"{outcome.plan.robot.name} {outcome.job}{times}: {verdict}")
