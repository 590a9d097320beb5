"""Printed reports, files and options of `run --motors` and `motors`."""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.arguments import finite_number, keep_files
from steptwin.host.cli.options import naming_options, option
from steptwin.host.cli.output import Columns, print_rows, progress_bar, say, warn
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.features.motors.sizing.fitting import CycleTime
    from steptwin.features.motors.sizing.margins import Border, MotorMargins
    from steptwin.features.motors.turning import MotorRun, MotorVerdict
    from steptwin.features.motors.turning.after_run import RotorTrace
    from steptwin.host.client import Progress
    from steptwin.host.robots.robot import Robot
    from steptwin.host.verify import Comparison, RunInfo
from collections.abc import Iterator

from steptwin.features.motors.evidence import RotorsSoFar

_SURE_AFTER_S: Final = 1.0
"""Time after which an estimated duration is printed."""
_LONG_S: Final = 10.0
"""Least duration that is announced."""


@dataclass(frozen=True, slots=True)
class LoadOptions:
    """Options that change payload, current or supply against the robot's file or the run."""

    payload: float | None = option("KG", "Mass at the tool instead of the robot file's.", read=finite_number)
    supply: float | None = option("V", "Supply of the drivers instead of the robot file's.", read=finite_number)
    current: float | None = option(
        "A", "Phase current at full torque instead of the run's or the robot's.", read=finite_number
    )

    def on(self, robot: "Robot") -> "Robot":
        """Return a robot with this payload and supply; raise InputError for impossible values."""
        check_motors(robot)
        if robot.dynamics is None:
            return robot
        asked = {"payload_kg": self.payload, "supply_v": self.supply}
        changes: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
        try:
            return replace(robot, dynamics=replace(robot.dynamics, **changes))
        except InputError as error:
            said = (
                str(error)
                .removeprefix("dynamics.")
                .replace("payload_kg:", "--payload:")
                .replace("supply_v:", "--supply:")
            )
            raise InputError(said) from error


def check_motors(robot: "Robot") -> None:
    """Raise InputError, with the missing key, if a robot's file does not describe its motors and masses."""
    from steptwin.features.motors.turning import check_described

    check_described(robot)


def motors_of(
    robot: "Robot",
    comparison: "Comparison",
    drivers: str,
    current_a: float | None = None,
    trace: "RotorTrace | None" = None,
) -> "MotorRun":
    """Turn the rotors by a run's record and judge them; `current_a` is the value of --current.

    `drivers` names those of the run. A `trace` comes from rotors that have turned with the run already.
    """
    from steptwin.features.motors.turning import motors_of_run
    from steptwin.host.twin.machine.drivers import driver_profile, other_drivers

    profile = driver_profile(robot.board, other_drivers(robot.board, drivers))
    title = f"motors of {robot.name}"
    with naming_options(current_a="--current"), progress_bar(title) as bar:
        telling = telling_time(bar, title)
        return motors_of_run(robot, comparison, profile, current_a=current_a, trace=trace, progress=telling)


def margins_of(ran: "MotorRun", comparison: "Comparison") -> "MotorMargins":
    """Search by how much a run keeps step."""
    from steptwin.features.motors.sizing.margins import margins_of_run, searches_of

    searches = searches_of(ran.driving, comparison)
    trials = sum(search.trials_max for search in searches)
    title = f"margins of {ran.driving.robot.name}"
    if trials * ran.wall_s > _LONG_S:
        say(f"{title}: at most {trials * ran.wall_s:.0f} s, for {trials} trials", err=True)
    with progress_bar(title) as bar:
        return margins_of_run(searches, ran.slip, bar)


def write_motor_pictures(folder: "Path", ran: "MotorRun", run: "RunInfo", names: Iterable[str] | None = None) -> None:
    """Draw pictures of a run's motors into a folder; by default all of them."""
    from steptwin.features.motors.sizing.motor_pictures import PICTURES
    from steptwin.host.record.plots import write_pictures

    pictures = [each for name, each in PICTURES.items() if names is None or name in names]
    write_pictures(folder, [each for each in pictures if ran.paths.task.width or not each.of_tool], run, ran)


def keep_pictures(folder: "Path", *, replace: bool) -> None:
    """Raise InputError if `write_motor_pictures` cannot draw, or would replace a picture without permission."""
    if not find_spec("matplotlib"):
        raise InputError(f"--out: matplotlib is not installed ({installing('plot')})")
    from steptwin.features.motors.sizing.motor_pictures import PICTURES

    keep_files((folder / f"{name}.png" for name in PICTURES), replace=replace)


CYCLE: Final = "motor-cycle.png"
"""File name of the picture of a program's durations."""


def keep_cycles(folder: "Path | None", *, replace: bool) -> None:
    """Raise InputError if `write_cycles` cannot draw, or would replace its picture without permission."""
    if folder is not None:
        if not find_spec("matplotlib"):
            raise InputError(f"--out: matplotlib is not installed ({installing('plot')})")
        keep_files((folder / CYCLE,), replace=replace)


def write_cycles(
    folder: "Path", robot: "Robot", cycles: "Mapping[str, Sequence[CycleTime]]", by_joints_s: float
) -> None:
    """Draw a program's duration by torque reserve."""
    import matplotlib as mpl

    from steptwin.features.motors.sizing.fitting import draw_cycles
    from steptwin.host.record.plots.canvas import STYLE, save_figure

    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        save_figure(draw_cycles(robot, cycles, by_joints_s), folder / CYCLE, {})


def keep_drawn(folder: "Path", ran: "MotorRun", run: "RunInfo", *, pictures: bool) -> None:
    """Draw those pictures of a run that need little time into its folder."""
    if pictures:
        from steptwin.features.motors.sizing.motor_pictures import IN_TIME

        write_motor_pictures(folder, ran, run, IN_TIME)


def telling_time(progress: "Progress", what: str) -> "Progress":
    """Return a progress function that announces a long total duration once, on stderr."""
    first: tuple[float, float] | None = None
    told = False

    def report(fraction: float) -> None:
        nonlocal first, told
        now_s = time.monotonic()
        if first is None:
            first = now_s, fraction  # until here functions may have been compiled
        elif not told and now_s - first[0] > _SURE_AFTER_S:
            told = True
            whole_s = (now_s - first[0]) / (fraction - first[1])
            if whole_s > _LONG_S:
                say(f"{what}: about {whole_s:.0f} s{_remedy()}", err=True)
        progress(fraction)

    return report


def _remedy() -> str:
    return "" if find_spec("numba") else f"; numba makes it some hundred times faster ({installing('fast')})"


_COLUMNS: Final[Columns] = {
    "joint": "{0.name}",
    "motor": "{0.motor}",
    "load angle deg": "{0.load_angle_deg:.1f}",
    "needs Nm": "{0.torque_needed_nm:.3f}",
    "has Nm": "{0.torque_available_nm:.3f}",
    "margin %": lambda joint: f"{100 * joint.margin:.0f}",
    "at rpm": "{0.margin_rpm:.0f}",
    "lost steps": "{0.lost_full_steps:g}",
    "winding degC": "{0.winding_celsius:.1f}",
    "repeated degC": "{0.winding_celsius_steady:.0f}",
}


def print_motors(verdict: "MotorVerdict") -> None:
    """Print a row for each joint, the warnings, and the verdict."""
    print_rows(_COLUMNS, verdict.joints, text_columns=2)
    for line in verdict.warnings:
        warn(line)
    tool = verdict.tool
    say(
        f"tool really reached: {tool.position_mm_max:.3f} mm from the counted pose at {tool.position_max_at_s:.3f} s,"
        f" {tool.attitude_deg_max:.3f} deg at most; at the end {tool.position_mm_end:.3f} mm,"
        f" {abs(tool.attitude_deg_end):.3f} deg",
        f"supply: {verdict.supply_v_min:.1f} to {verdict.supply_v_max:.1f} V",
    )
    said = "keep step" if verdict.kept_step else "LOSE STEPS"
    others = "".join(f", then {payload_kg:g} kg" for payload_kg in verdict.other_payloads_kg)
    say(
        f"motors: {said}, with {verdict.payload_kg:g} kg{others} at the tool and {verdict.supply_v:g} V ([A] masses)",
        *(f"  {reason}" for reason in verdict.reasons),
    )


def warn_of_payloads(document: Mapping[str, Any], payload_kg: float) -> None:
    """Warn if a stored run's scenario has changed the payload; motors that turn after the run do not know it."""
    requests = [fault.get("do", {}) for fault in document.get("faults", ()) if fault.get("strikes")]
    given = [request["payload_kg"] for request in requests if request.get("do") == "payload"]
    if given:
        told = ", then ".join(f"{each:g} kg" for each in given)
        warn(f"the run's scenario has changed the payload to {told}: these motors turn {payload_kg:g} kg all along")


_UNITS: Final = {"current_a": " A", "payload_kg": " kg", "stretch": ""}
_SAID: Final = {
    "current_a": "lowest current",
    "payload_kg": "largest payload",
    "stretch": "shortest stretch",
}


def print_margins(margins: "MotorMargins") -> None:
    """Print a row for each border."""
    say(*(f"{_SAID[border.quantity]}: {_border(border)}" for border in margins.borders))


def _border(border: "Border") -> str:
    unit = _UNITS[border.quantity]
    run = "the motion as it is" if border.quantity == "stretch" else f"the run has {border.run:.3g}{unit}"
    slips = f"{border.joint} slips at {border.slips_at_s:.3f} s" if border.slips_at_s is not None else ""
    if border.keeps is None:
        return f"none keeps step, up to {border.limit:.3g}{unit} ({run}; there {slips})"
    if border.slips is None:
        return f"{border.keeps:.3g}{unit} still keeps step, the end of the range ({run})"
    return f"{border.keeps:.3g}{unit} ({run}; at {border.slips:.3g}{unit} {slips})"


# --- on a served board: this module is the feature's `LiveWords`


def banner() -> str:
    """Return that the motors turn."""
    return "motors turn with it ([A] masses)"


def warnings(seen: RotorsSoFar) -> Iterator[str]:
    """Yield a line for each rotor that has slipped: without encoders the board does not know it."""
    for slip in seen.slips(0):
        yield f"{slip.name}: its rotor has slipped, {slip.at_s:.3f} s after power-up; homing finds the position again"


_ROTORS: Final[Columns] = {
    "motor": "{0[name]}",
    "load angle deg": "{0[load_angle_deg]:.1f}",
    "at s": "{0[load_angle_at_s]:.3f}",
    "first slip s": lambda joint: "-" if joint["first_slip_s"] is None else f"{joint['first_slip_s']:.3f}",
    "lost steps": "{0[lost_full_steps]:g}",
    "winding degC": "{0[winding_celsius]:.1f}",
}


def print_report(document: Mapping[str, Any]) -> None:
    """Print a row for each motor."""
    print_rows(_ROTORS, document["joints"])
