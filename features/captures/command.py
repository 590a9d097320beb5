"""`steptwin capture FILE` and `verify --capture FILE`: tell what a logic analyser has recorded, and verify it."""

import re
import shlex
from dataclasses import MISSING, dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, positive_number, run_folder
from steptwin.host.cli.options import argument, naming_options, option, switch
from steptwin.host.cli.output import print_table, say, warn
from steptwin.host.cli.run.verdict_text import print_report
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from steptwin.features.captures.capture import Capture
    from steptwin.features.captures.channel_map import AxisSignals
    from steptwin.features.captures.judging import CapturedRun, CaptureJudge
    from steptwin.host.planning.plan import Plan
    from steptwin.host.robots.robot import Robot
    from steptwin.host.verify.clock_fit import ClockFit


_UNITS_S: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_ALL: Final = "all"
_EXACT: Final = "exact"
_ONE_CLOCK_PPM: Final = 0.5
"""Difference of the clocks up to which `--clock-ppm exact` takes them for one: what a short motion leaves open."""
_SampleRate = str | None
_TOLERANCE_STEPS: Final = 1.5
_CLOCK_PPM: Final = "200"


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureOptions:
    """The options of `verify` for a capture."""

    capture: Path | None = option("FILE", "Verify a logic analyser's record of a real controller, instead of DIR.")
    maps: list[str] | None = option(
        "AXIS=STEP,DIR[,ENABLE]", "Channels of an axis; ! inverts one, as in th1=D0,!D1; repeatable.", "--map"
    )
    path: Path | None = option(
        "DIR|'ROBOT JOB [KEY=VALUE ...]'", "Plan whose path the steps should follow, at any speed, instead of --plan."
    )
    controller: str | None = option(
        "NAME", "Step rule with --path: klipper, grbl, grblhal, marlin, linuxcnc or other; estimated by default."
    )
    both_edges: bool = switch("With --path: each edge of STEP is a step, as of Klipper with TMC drivers.")
    robot: str | None = option("ROBOT", "The robot, for a capture without --plan.")
    rate: _SampleRate = option("RATE", "Sampling rate, such as 24MHz, if the file does not tell it.")
    glitch: str | None = option("TIME", "Drop two edges of a channel that are closer, such as 1us.")
    tolerance_steps: float = option(
        "STEPS", "Largest distance of a count from the plan; 2 for grbl.", default=_TOLERANCE_STEPS
    )
    clock_ppm: str = option("PPM|exact", "Largest difference of the two clocks.", default=_CLOCK_PPM)
    driver_profile: str | None = option("NAME|all", "Other drivers; all: which of them would miss pulses?")
    out: str | None = option("DIR", "Write the folder of a run, with pictures, for `view` and `plot`.")

    @property
    def usage(self) -> str:
        """The option that names the capture."""
        return "--capture FILE"

    @property
    def source(self) -> str | None:
        """The capture, as it is named; None without one."""
        return None if self.capture is None else f"--capture {self.capture}"

    def verify(self, answer: AnswerOptions, plan: Path | None) -> bool:
        """Verify the capture beside a plan, a folder or `ROBOT JOB`; without one tell steps, rates and limits."""
        if self.path is not None:
            if plan is not None:
                raise InputError(f"--path {self.path} and --plan {plan}: give only one of them")
            return _verify_path(answer, self, self.path)
        for name, given in (("--controller", self.controller), ("--both-edges", self.both_edges)):
            if given:
                raise InputError(f"{name}: is for --path")
        return _verify_capture(answer, self, plan)

    def judge(self) -> "CaptureJudge":
        """Return how the capture is judged; raise InputError for a value that is wrong."""
        from steptwin.features.captures.judging import CaptureJudge

        exact = self.clock_ppm == _EXACT
        if not self.tolerance_steps > 0.0:
            raise InputError(f"--tolerance-steps {self.tolerance_steps:g}: is not above 0")
        return CaptureJudge(
            maps=tuple(self.maps or ()),
            glitch_s=0.0 if self.glitch is None else _time_s(self.glitch, "--glitch"),
            tolerance_steps=self.tolerance_steps,
            clock_ppm=_ONE_CLOCK_PPM if exact else positive_number(self.clock_ppm, "--clock-ppm"),
            driver_profile=None if self.driver_profile == _ALL else self.driver_profile,
            currents=self.out is not None,
        )


@command("night.sr", "night.vcd --json")
def capture(
    answer: AnswerOptions,
    file: Path = argument(
        "FILE", "A record of sigrok (.sr), a VCD, a CSV or binary export of a logic analyser.", MISSING
    ),
    rate: _SampleRate = option("RATE", "Sampling rate, such as 24MHz, if the file does not tell it."),
) -> None:
    """Tell what a logic analyser has recorded: channels, shortest pulses, and which look like STEP and DIR."""
    from steptwin.features.captures.channel_map import capture_facts
    from steptwin.features.captures.reading import read_capture

    with naming_options("rate"):
        facts = capture_facts(read_capture(file, rate))
    answer.tell({"file": str(file), **facts}, lambda: _print_facts(file, facts))


def _time_s(text: str, name: str) -> float:
    found = re.fullmatch(r"([0-9.]+) ?(s|ms|us|ns)", text)
    if not found:
        raise InputError(f"{name} {text}: is no time with a unit, such as 1us")
    return positive_number(found[1], name) * _UNITS_S[found[2]]


def _verify_capture(answer: AnswerOptions, options: CaptureOptions, plan: Path | None) -> bool:
    from steptwin.features.captures.judging import judge_capture
    from steptwin.features.captures.reading import read_capture

    begun_s, judge = perf_counter(), options.judge()
    with _naming():
        robot, job, planned = _planned(options, plan)
        if planned is None:
            return _tell_alone(answer, options, robot, judge)
        folder = None if options.out is None else run_folder(options.out)
        run = judge_capture(
            read_capture(options.capture or "", options.rate),
            robot,
            job,
            planned.motion,
            judge,
            wall_s=perf_counter() - begun_s,
        )
    document = run.to_dict() | {"driver_profile": judge.driver_profile or robot.board.profile.name}
    if options.driver_profile == _ALL:
        document["drivers"] = _by_driver(robot, run.capture, run.signals, run.clock)
    if folder is not None:
        document = _keep(answer, folder, document, planned, run)
    answer.tell(document, lambda: _print_run(document))
    for hint in run.hints:
        warn(hint)
    return run.passed


def _verify_path(answer: AnswerOptions, options: CaptureOptions, path: Path) -> bool:
    """Verify a capture beside the path of a plan; return whether it passed."""
    from steptwin.features.captures.path_verdict import judge_by_path
    from steptwin.features.captures.reading import read_capture
    from steptwin.features.captures.step_rules import CONTROLLERS, controller

    for name, given in (
        ("--out", options.out is not None),
        ("--tolerance-steps", options.tolerance_steps != _TOLERANCE_STEPS),
        ("--clock-ppm", options.clock_ppm != _CLOCK_PPM),
    ):
        if given:
            raise InputError(f"{name}: is for --plan; --path has no time law")
    rule = None if options.controller is None else controller(options.controller)
    if options.both_edges and rule is not None and not rule.both_edges:
        able = ", ".join(name for name, each in CONTROLLERS.items() if each.both_edges)
        raise InputError(f"--both-edges: {rule.name} steps at one edge of STEP; at both may {able}")
    judge = options.judge()
    with _naming():
        robot, job, planned = _planned(options, path, "--path")
        assert planned is not None
        capture = read_capture(options.capture or "", options.rate)
        run = judge_by_path(capture, robot, planned.motion, judge, rule, both_edges=options.both_edges)
    document = run.to_dict() | {"driver_profile": judge.driver_profile or robot.board.profile.name}
    if options.driver_profile == _ALL and not options.both_edges:
        document["drivers"] = _by_driver(robot, run.alone.capture, run.alone.signals, run.alone.clock)
    answer.tell(document, lambda: _print_path(f"{robot.name} {job}", document))
    for hint in run.hints:
        warn(hint)
    return run.passed


def _tell_alone(answer: AnswerOptions, options: CaptureOptions, robot: "Robot", judge: "CaptureJudge") -> bool:
    """Tell steps, rates and limits of a capture without a plan; return whether all limits were kept."""
    from steptwin.features.captures.judging import judge_alone
    from steptwin.features.captures.reading import read_capture

    if options.out is not None:
        raise InputError("--out: needs --plan, beside which the folder shows the capture")
    alone = judge_alone(read_capture(options.capture or "", options.rate), robot, judge)
    document = alone.to_dict() | {"driver_profile": judge.driver_profile or robot.board.profile.name}
    if options.driver_profile == _ALL:
        document["drivers"] = _by_driver(robot, alone.capture, alone.signals, alone.clock)
    answer.tell(document, lambda: _print_alone(f"{robot.name} {options.capture}", document))
    for hint in alone.hints:
        warn(hint)
    return alone.passed


def _naming() -> Any:
    return naming_options("map", "rate", driver_profile="--driver-profile")


def _planned(options: CaptureOptions, plan: Path | None, name: str = "--plan") -> "tuple[Robot, str, Plan | None]":
    """Return the robot, the words for the motion, and the motion; None without a plan."""
    from steptwin.host.planning import planner
    from steptwin.host.planning.programs.step_files import is_step_file
    from steptwin.host.record.folder import read_robot, stored_motion
    from steptwin.host.robots import load_robot

    if plan is None:
        if options.robot is None:
            raise InputError(
                "--capture: --plan DIR or --plan 'ROBOT JOB' is missing, or --path, or --robot ROBOT without a plan"
            )
        return load_robot(options.robot), "", None
    if options.robot is not None:
        raise InputError(f"--robot {options.robot}: {name} {plan} names the robot")
    if plan.is_dir():
        robot = read_robot(plan)
        return robot, f"capture of {plan.name}", planner.plan_executed(robot, stored_motion(plan, robot))
    words = shlex.split(str(plan))
    if len(words) < 2:
        raise InputError(f"{name} {plan}: is neither a folder nor 'ROBOT JOB' nor 'ROBOT FILE'")
    with prefixed(f"{name}: "):
        given = name_value_pairs(words[2:])
    if name == "--path" and is_step_file(words[1]):  # a controller goes to the very corners of its file
        given = {"blend_mm": "0", **given}
    return _of_words(words[0], words[1], given)


def _of_words(name: str, job: str, options: "Mapping[str, str]") -> "tuple[Robot, str, Plan | None]":
    from steptwin.host.cli.run.chosen_motion import choose_motion
    from steptwin.host.robots import load_robot

    robot = load_robot(name)
    chosen = choose_motion(robot, job, options)
    return robot, f"capture of {chosen.job}", chosen.plan


def _by_driver(
    robot: "Robot", capture: "Capture", signals: "Sequence[AxisSignals]", clock: "ClockFit"
) -> list[dict[str, Any]]:
    from steptwin.features.captures.each_driver import by_each_driver

    return [each.to_dict() for each in by_each_driver(capture, robot, signals, clock)]


def _keep(
    answer: AnswerOptions, folder: Path, document: dict[str, Any], planned: "Plan", run: "CapturedRun"
) -> dict[str, Any]:
    """Write the folder of a run; return the document with its version."""
    from steptwin.host.record.folder import FOLDER_VERSION, VERSION_KEY, write_folder
    from steptwin.host.record.folder.writing import can_draw, draw_pictures

    document = document | {VERSION_KEY: FOLDER_VERSION}
    write_folder(folder, document, planned, run.comparison.evidence, ())
    if pictures := can_draw():
        draw_pictures(folder)
    answer.add_files(
        "report, edges and pictures are" if pictures else "report and edges are", folder, pictures=pictures
    )
    return document


# --- words


def _print_facts(file: Path, facts: dict[str, Any]) -> None:
    rate = f"{facts['rate_hz']:g} Hz" if facts["rate_hz"] else "a rate that it does not tell (--rate)"
    say(f"{file}: {facts['kind']}, {facts['duration_s']:.6g} s at {rate}")
    rows = [
        [
            each["name"],
            str(each["edges"]),
            *(_figure(each[key]) for key in ("shortest_pulse_us", "usual_pulse_us", "fastest_hz")),
        ]
        for each in facts["channels"]
    ]
    print_table(["channel", "edges", "shortest us", "usual us", "fastest Hz"], rows, text_columns=1)
    for pair in facts["pairs"]:
        if others := pair.get("or"):
            dirs = " or ".join([pair["dir"], *others])
            say(f"looks like an axis: STEP {pair['step']}, but its DIR is ambiguous: {dirs} change while it rests")
        else:
            say(f"looks like an axis: --map AXIS={pair['step']},{pair['dir']}")
    for told in facts["told"]:
        warn(told)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def _print_alone(title: str, document: dict[str, Any]) -> None:
    rows = [
        [
            each["name"],
            str(each["pulses"]),
            f"{each['steps']:+d}",
            str(each["reversals"]),
            f"{each['peak_rate_hz']:.0f}",
        ]
        for each in document["axes"]
    ]
    print_table(["axis", "pulses", "steps", "reversals", "peak Hz"], rows, text_columns=1)
    _print_limits(document["capture"])
    for each in document.get("drivers", ()):
        _print_driver(each)
    say(*(f"reason: {reason}" for reason in document["reasons"]))
    say(f"{title}, without a plan: {'PASSED' if document['passed'] else 'FAILED'}")


def _print_path(title: str, document: dict[str, Any]) -> None:
    captured, path = document["capture"], document["path"]
    say(
        f"{captured['kind']}, {captured['duration_s']:.6g} s at {captured['rate_hz']:g} Hz: {' '.join(captured['map'])}"
    )
    half = f"each count within {path['half_steps']:.2f} steps of the path"
    if path["estimated"]:
        say(f"step rule estimated: {half}, as of {path['rule']}; the name is a guess")
    else:
        say(f"step rule of {path['rule']}: {half}; {path['says']}")
    along = "" if path["distance_mm"] is None else f" along {path['distance_mm']:.3f} mm"
    say(f"by path, at any speed: {sum(each['steps'] for each in path['axes'])} steps{along}")
    if path["before"]:
        say(f"left out: {path['before']} steps before the motion, such as homing")
    rows = [
        [each["name"], str(each["start"]), str(each["end"]), f"{each['planned_end_steps']:.2f}", str(each["steps"])]
        for each in path["axes"]
    ]
    print_table(["axis", "start", "end", "planned end", "steps"], rows, text_columns=1)
    if path["both_edges"]:
        say("drivers' limits are not judged: none of the drivers here steps at both edges")
    _print_limits(captured)
    for each in document.get("drivers", ()):
        _print_driver(each)
    say(*(f"reason: {reason}" for reason in document["reasons"]))
    if document["passed"]:
        say(f"no path shows {path['not_shown']}")
    say(f"{title}, by path: {'PASSED' if document['passed'] else 'FAILED'}")


def _print_run(document: dict[str, Any]) -> None:
    captured = document["capture"]
    clock = captured["clock"]
    say(
        f"{captured['kind']}, {captured['duration_s']:.6g} s at {captured['rate_hz']:g} Hz: {' '.join(captured['map'])}"
    )
    if clock["pairs"]:
        say(
            f"the plan's t = 0 is at {clock['offset_s']:.7f} s +- {1e6 * clock['offset_uncertainty_s']:.2g} us,"
            f" the analyser's clock {clock['ppm']:+.2f} +- {clock['ppm_uncertainty']:.2g} ppm"
        )
    say(f"not recorded, assumed: {', '.join(captured['assumed'])}")
    dropped = sum(captured["glitches"].values())
    if dropped:
        say(f"glitches dropped: {dropped}")
    _print_limits(captured)
    for each in document.get("drivers", ()):
        _print_driver(each)
    print_report(document)


def _print_driver(answer: dict[str, Any]) -> None:
    if answer["refused"]:
        said = answer["refused"]
    elif answer["missed"]:
        said = f"misses {answer['missed']} pulses, from {answer['first_s']:.3f} s on"
    else:
        said = "misses none"
    say(f"with {answer['name']}: {said}")


def _print_limits(captured: dict[str, Any]) -> None:
    """Tell of each limit whether it was kept, and how it is known, in one line for all axes where they agree."""
    axes: dict[str, list[str]] = {}
    for each in captured["limits"]:
        axes.setdefault(each["said"], []).append(each["axis"])
    for said, names in axes.items():
        say(f"{' '.join(names)}: {said}")
