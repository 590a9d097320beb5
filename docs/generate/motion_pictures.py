"""Draw the pictures of docs/motions.md, programs.md and motors.md: corners, limits, torques, swings."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple, Self

import numpy as np
from matplotlib.figure import Figure

from docs.generate.commands import DOCS
from docs.generate.drawing import write_picture
from steptwin.features.motors.limits import motor_limits
from steptwin.features.motors.turning import motors_of_run
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.findings import Findings
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program, read_program
from steptwin.host.record.plots.canvas import COUNTED, LIMIT
from steptwin.host.robots import load_robot, parse_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.motor import JointMotor
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute

_ROBOT: Final = load_robot("teaching-scara")
_SLOWER: Final = "#d08a1d"
_PLATE_Z_MM: Final = -60.0

_CORNER: Final = """
start = {{ x = 140.0, y = 20.0, z = -60.0, phi = 0.0, branch = "right" }}
[[step]]
line = {{ x = 90.0 }}
speed_mm_s = 60.0
{blend}
[[step]]
line = {{ y = 70.0 }}
speed_mm_s = 60.0
"""
_BLENDS: Final = {
    "with a stop": ("", LIMIT, ":"),
    "blend_mm = 4": ("blend_mm = 4.0", _SLOWER, "--"),
    "blend_mm = 10": ("blend_mm = 10.0", COUNTED, "-"),
}
"""For each label the key of the first step, and colour and style of the lines."""

_PICK: Final = """
{law}
start = "tray"
[positions]
tray = {{ th1 = 0.0, th2 = 90.0, d3 = 50.0, th4 = 0.0 }}
fixture = {{ th1 = -60.0, th2 = 60.0, d3 = 50.0, th4 = 20.0 }}
[[step]]
go = "fixture"
speed_percent = 100.0
[[step]]
go = "tray"
speed_percent = 100.0
"""
_LAWS: Final = {
    'law = "s-curve"': ("", _SLOWER, "--"),
    'law = "fastest"': ('law = "fastest"', COUNTED, "-"),
}


def write_motion_pictures() -> None:
    """Draw the pictures again."""
    write_picture(DOCS / "pictures" / "motions-corner.png", _corner)
    write_picture(DOCS / "pictures" / "motions-fastest.png", _fastest)
    write_picture(DOCS / "pictures" / "gcode-engraving.png", _engraving)
    write_picture(DOCS / "pictures" / "motors-fastest.png", _motors)
    write_picture(DOCS / "pictures" / "motors-cycle.png", _cycle)
    write_picture(DOCS / "pictures" / "shaping.png", _shaping)


def _motions(program: str, variants: dict[str, tuple[str, str, str]], key: str) -> Iterator[tuple[str, Motion]]:
    for label, (text, _, _) in variants.items():
        parsed = parse_program(program.format(**{key: text}), Findings())
        yield label, compile_program(parsed, _ROBOT).motion


def _tool_mm(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return each millisecond, and the tool there."""
    t_s = np.arange(round(1000 * motion.duration_s) + 1) / 1000
    return t_s, make_kinematics(_ROBOT).forward(motion.positions(t_s))[:, :3]


_LAB: Final = "lab-scara"
_SWING: Final = """
law = "fastest"
start = "a"
{limits}
[positions]
a = {{ d1 = 100.0, th2 = -30.0, th3 = 60.0, th4 = 0.0 }}
b = {{ d1 = 100.0, th2 = 40.0, th3 = -20.0, th4 = 90.0 }}
[[step]]
go = "b"
speed_percent = 100.0
[[step]]
go = "a"
speed_percent = 100.0
"""
_LEFT_PERCENT: Final = (5, 10, 20, 30, 40, 50, 60, 70)
_STRONGER: Final = "23HS22-2804S"


def _swing(robot: Robot, left_percent: float | None) -> Motion:
    """Return the page's swing of the laboratory's arm, within some percent of the motors' torque or by joints alone."""
    limits = "" if left_percent is None else f'[limits]\nfrom = "motors"\nleft_percent = {left_percent:g}'
    program = parse_program(_SWING.format(limits=limits), Findings())
    return compile_program(program, robot, drives=motor_limits).motion


def _motors() -> Figure:
    """Draw the torque that the shoulder's motor needs in the swing, by its speed, and what there is."""
    robot = load_robot(_LAB)
    axis = robot.axis_names.index("th2")
    figure = Figure(figsize=(10, 4.8), layout="constrained")
    figure.suptitle("lab-scara, th2: torque that a swing of 70 degrees needs, beside its motor's", x=0.01, ha="left")
    axes = figure.subplots()
    for label, left, color, style in (
        ("limits of the joints alone", None, _SLOWER, "--"),
        ("30 % left", 30.0, COUNTED, "-"),
    ):
        run = motors_of_run(robot, execute(plan(robot, _swing(robot, left)), "").comparison)
        torques, rpm = run.torques.needed_nm[:, axis], np.abs(run.torques.rpm[:, axis])
        axes.plot(rpm, np.abs(torques), style, color=color, linewidth=1.0, label=label)
    curve = run.torques.curves[axis]
    axes.plot(curve.rpm, curve.torque_nm, color=LIMIT, label="pull-out torque")
    axes.plot(curve.rpm, 0.7 * curve.torque_nm, ":", color=LIMIT, label="70 % of it")
    axes.set(xlabel="speed of the motor [rpm]", ylabel="torque [Nm]", xlim=(0.0, 100.0), ylim=(0.0, 1.2))
    axes.legend(loc="upper right")
    return figure


def _cycle() -> Figure:
    """Draw how long the swing takes by the torque that is left, also with a stronger motor at the shoulder."""
    robot = load_robot(_LAB)
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    figure.suptitle("lab-scara: there and back, by the torque that its motors are to have left", x=0.01, ha="left")
    axes = figure.subplots()
    shoulder = robot.joint("th2")
    stronger = replace(
        robot,
        joints=tuple(
            replace(each, motor=JointMotor(model=_STRONGER)) if each is shoulder else each for each in robot.joints
        ),
    )
    for label, of, color, style in (
        (f"th2: {shoulder.motor.model if shoulder.motor else ''}", robot, COUNTED, "o-"),
        (f"th2: {_STRONGER}", stronger, _SLOWER, "s--"),
    ):
        times_s = [_swing(of, left).duration_s for left in _LEFT_PERCENT]
        axes.plot(_LEFT_PERCENT, times_s, style, color=color, markersize=4, label=label)
    axes.axhline(
        _swing(robot, None).duration_s, color=LIMIT, linewidth=1.0, label="limits of the joints: steps are lost"
    )
    axes.set(xlabel="left_percent [%]", ylabel="duration [s]", xlim=(0, 70), ylim=(0.0, None))
    axes.legend(loc="lower right")
    return figure


_STOP: Final = """
start = "a"
[positions]
a = { d1 = 60.0, th2 = -15.0, th3 = 30.0, th4 = 0.0 }
b = { d1 = 60.0, th2 = 15.0, th3 = 30.0, th4 = 0.0 }
[[step]]
go = "b"
speed_percent = 6.0
[[step]]
pause = 1.0
"""
_SHAPERS: Final = {"unshaped": (LIMIT, ":"), "zv": (_SLOWER, "--"), "mzv": (COUNTED, "-"), "ei": ("#4c9f70", "-.")}


class Swing(NamedTuple):
    """A swing of the shoulder, and the tool after its end.

    Attributes:
        lasts_s: duration of the swing.
        behind_deg: greatest angle of a rotor behind its field.
        after_s: shape (n,), times after the end.
        off_mm: shape (n,), how far the tool is off its place then, along the swing.
    """

    lasts_s: float
    behind_deg: float
    after_s: FloatArray
    off_mm: FloatArray

    @classmethod
    def shaped(cls, kind: str) -> Self:
        """Return the page's swing of the laboratory's arm with a shaper, by the model of motors."""
        tables = (f'[shaping.{joint}]\nkind = "{kind}"\nfrom = "motors"' for joint in ("th2", "th3"))
        plain = load_robot(_LAB)
        robot = plain if kind == "unshaped" else parse_robot("\n".join([plain.toml, *tables]), kind)
        planned = plan(robot, compile_program(parse_program(_STOP, Findings()), robot).motion)
        run = motors_of_run(robot, execute(planned, kind).comparison)
        lasts_s = planned.motion.duration_s - 1.0
        after_s = run.paths.t_s - lasts_s
        after = (after_s >= 0.0) & (after_s < 1.0)
        off_mm = (run.paths.reached - run.paths.counted)[after, :2]
        radius_mm = run.paths.counted[after][0, :2]
        along = np.array([-radius_mm[1], radius_mm[0]]) / np.linalg.norm(radius_mm)
        return cls(lasts_s, float(np.abs(run.trace.load_deg).max()), after_s[after], off_mm @ along)

    @property
    def swings_mm(self) -> float:
        """How far the tool goes to and fro, from 0.1 s after the end on: until then friction lets it creep."""
        return float(np.ptp(self.off_mm[self.after_s >= 0.1]))


def _shaping() -> Figure:
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    figure.suptitle("lab-scara: the tool after a swing of 30 degrees, by the model of motors", x=0.01, ha="left")
    axes = figure.subplots()
    for kind, (color, style) in _SHAPERS.items():
        swing = Swing.shaped(kind)
        label = f"{kind}: {swing.lasts_s:.2f} s, then {swing.swings_mm:.2f} mm to and fro"
        axes.plot(swing.after_s, swing.off_mm, style, color=color, label=label)
    axes.set(
        xlabel="time after the end of the motion [s]", ylabel="off its place, along the swing [mm]", xlim=(0.0, 1.0)
    )
    axes.legend(loc="upper right")
    return figure


def _engraving() -> Figure:
    """Draw the page's engraving as the motion makes it, and a corner of it beside the lines of the file."""
    program = read_program(str(DOCS / "programs" / "engraving" / "compass.toml"))
    tool_mm = _tool_mm(compile_program(program, _ROBOT).motion)[1]
    cuts = tool_mm[:, 2] < _PLATE_Z_MM
    figure = Figure(figsize=(10, 5.2), layout="constrained")
    figure.suptitle("compass.ngc: the tool from above, and a point of the star from nearby", x=0.01, ha="left")
    whole, near = figure.subplots(1, 2)
    for axes in (whole, near):
        for is_cut, color, style, label in (
            (False, _SLOWER, ":", "above the plate"),
            (True, COUNTED, "-", "in the plate"),
        ):
            shown = np.where((cuts == is_cut)[:, np.newaxis], tool_mm, np.nan)
            axes.plot(shown[:, 0], shown[:, 1], style, color=color, label=label)
        axes.set(aspect="equal", xlabel="x [mm]")
    tip = np.array([130.0, 0.0]) + 22.0 * np.array([np.cos(np.deg2rad(120.0)), np.sin(np.deg2rad(120.0))])
    near.set(xlim=(tip[0] - 0.8, tip[0] + 0.8), ylim=(tip[1] - 0.9, tip[1] + 0.7))
    near.plot(*tip, "+", color=LIMIT, markersize=9, label="corner in the file")
    whole.set_ylabel("y [mm]")
    figure.legend(*near.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _corner() -> Figure:
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    figure.suptitle(
        "A right corner between two lines at 60 mm/s: the tool from above, and its speed", x=0.01, ha="left"
    )
    path, speed = figure.subplots(1, 2, width_ratios=(1, 1.35))
    for label, motion in _motions(_CORNER, _BLENDS, "blend"):
        _, color, style = _BLENDS[label]
        t_s, tool_mm = _tool_mm(motion)
        speeds = np.linalg.norm(np.diff(tool_mm, axis=0), axis=1) / 1e-3
        name = f"{label}: {motion.duration_s:.2f} s"
        path.plot(tool_mm[:, 0], tool_mm[:, 1], style, color=color)
        speed.plot(t_s[1:], speeds, style, color=color, label=name)
    path.set(xlim=(84.0, 112.0), ylim=(14.0, 42.0), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    speed.set(xlabel="t [s]", ylabel="speed of the tool [mm/s]", ylim=(0.0, 75.0), xlim=(0.0, None))
    speed.legend(loc="upper right")
    return figure


def _fastest() -> Figure:
    figure = Figure(figsize=(10, 5.4), layout="constrained")
    figure.suptitle(
        "Both ways between two positions at 100 %: what the joint with the least left uses of its limits",
        x=0.01,
        ha="left",
    )
    rows = figure.subplots(2, 1, sharex=True)
    for label, motion in _motions(_PICK, _LAWS, "law"):
        _, color, style = _LAWS[label]
        t_s = np.arange(round(1000 * motion.duration_s) + 1) / 1000
        velocities = motion.velocities(t_s)
        speeds = _use_percent(velocities, [joint.speed_max for joint in _ROBOT.joints])
        rows[0].plot(t_s, speeds, style, color=color)
        limits = [joint.acceleration_max for joint in _ROBOT.joints]
        accelerations = _use_percent(np.diff(velocities, axis=0) / 1e-3, limits)
        rows[1].plot(t_s[1:], accelerations, style, color=color, label=f"{label}: {motion.duration_s:.2f} s")
    for axes, name in zip(rows, ("speed", "acceleration"), strict=True):
        axes.axhline(100.0, color=LIMIT, linewidth=1.0)
        axes.set(ylabel=f"{name} [% of the limit]", ylim=(0.0, 118.0), xlim=(0.0, None))
    rows[1].set_xlabel("t [s]")
    figure.legend(*rows[1].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _use_percent(values: FloatArray, limits: list[float]) -> FloatArray:
    """Return the largest part of a limit that a joint uses at each time, of values of shape (n, joints)."""
    percent: FloatArray = 100 * (np.abs(values) / np.array(limits)).max(axis=1)
    return percent
