"""Draw the pictures of docs/papers: three for each run, small enough for a repository."""

import re
from functools import partial
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from docs.generate.commands import DOCS
from docs.generate.drawing import write_motor_picture, write_picture, write_run_picture
from docs.generate.paper_pages import PAPERS, PICTURE_KINDS, picture, read_paper
from docs.generate.runs import Runs
from steptwin.features.calibration.identification import identify_errors
from steptwin.features.calibration.measurements import simulate_measurements
from steptwin.features.calibration.residuals import draw_residuals
from steptwin.features.motors.turning import motors_of_run
from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.section import Shelf
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.findings import Findings
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.record.plots import DEFAULT_VIEW, PlotView
from steptwin.host.robots import MACHINES, load_robot, parse_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.kinematics.links import Role
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute

_DRAWN: Final = dict(zip(PICTURE_KINDS, ("in-space", "joints", "error"), strict=True))
"""For each kind of picture on the page, its name in `steptwin.host.record.plots`."""


def write_pictures(runs: Runs) -> None:
    """Draw the pictures of each paper's experiment."""
    for robot in PAPERS:
        job = read_paper(robot).job
        for kind, name in _DRAWN.items():
            write_run_picture(DOCS / picture(robot, job, kind), name, runs.outcome(robot, job))


_MACHINE_PICTURES: Final = {
    "chain": ("path", "in-space"),
    "cartesian": ("path", "in-space"),
    "axes": ("joints", "joints"),
}
"""For each kind of machine the kind of its example's picture, and its name in `steptwin.host.record.plots`."""


def write_machine_pictures() -> None:
    """Draw the example of each machine of docs/machines.md."""
    for name in MACHINES:
        write_machine_picture(load_robot(name))


def write_machine_picture(robot: Robot) -> None:
    """Draw the example of a machine."""
    kind, drawn = _MACHINE_PICTURES[robot.kinematics]
    example = f"docs/programs/{robot.name}.toml"
    program = parse_program((DOCS.parent / example).read_text(encoding="utf-8"), Findings())
    outcome = execute(plan(robot, compile_program(program, robot).motion), example)
    write_run_picture(DOCS / picture(robot.name, "example", kind), drawn, outcome)
    if robot.dynamics is not None:
        turned = motors_of_run(robot, outcome.comparison)
        path = DOCS / picture(robot.name, "example", "torque")
        write_motor_picture(path, "motor-torque", outcome.report.run, turned)


_KIND: Final = "calibration-scara"
_NAME: Final = "my-arm"
_ERRORS: Final = re.compile(r"^<!-- calibration -->\n```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)
_MEASURE: Final = re.compile(r"--simulate (\d+) --noise-mm (\S+) --seed (\d+)")


def write_calibration_picture() -> None:
    """Calibrate the page's arm by the measurements that the page's command simulates."""
    page = (DOCS / "machines.md").read_text(encoding="utf-8")
    errors, measure = _ERRORS.search(page), _MEASURE.search(page)
    if not (errors and measure):
        raise ValueError("docs/machines.md has no errors.toml, or no --simulate")
    text = robot_text(_NAME, _KIND, *with_settings(_KIND, {}))
    nominal, real = (parse_robot(each, _NAME) for each in (text, text + errors[1]))
    measured = simulate_measurements(real, int(measure[1]), float(measure[2]), int(measure[3]))
    found = identify_errors(Chain.of(nominal), measured)
    write_picture(DOCS / "pictures" / "calibration-residuals.png", partial(draw_residuals, _NAME, found))


_VIEWS: Final = {"edges": PlotView(1.94, 0.06), "phases": DEFAULT_VIEW, "jitter": DEFAULT_VIEW, "widths": DEFAULT_VIEW}
"""For each picture the window that it shows: Z5 turns around at 1.94 s."""


def write_waveform_pictures(runs: Runs) -> None:
    """Draw the pictures again."""
    outcome = runs.outcome("hybrid-arm", "helix")
    for name, view in _VIEWS.items():
        write_run_picture(DOCS / "pictures" / f"waveform-{name}.png", name, outcome, view)


PICTURE: Final = DOCS / "pictures" / "warehouse.png"
_ROBOT: Final = "warehouse-scara"
_OPTIONS: Final = {"slot": "B2", "pick_up": "pick-up"}
_SHELF_VIEWS: Final = (("from above", 0, 1), ("from the front", 0, 2))
"""Title of each view, with the coordinates that it shows across and up."""
_ACROSS_MM: Final = (250.0, 1250.0)
_UP_MM: Final = {1: (-290.0, 400.0), 2: (-20.0, 440.0)}
"""What the views show."""
_SHELF, _DRAWER, _TABLE, _ARM, _PATH = "0.88", "#d9b36c", "0.75", "#0b3c6f", "#a02010"


def write_warehouse_picture() -> None:
    """Write the picture."""
    write_picture(PICTURE, _draw)


def _draw() -> Figure:
    robot = load_robot(_ROBOT)
    shelf = shelf_of(robot)
    if shelf is None:
        raise ValueError(f"{_ROBOT} has no shelf")
    motion = make_job(robot, "store", _OPTIONS)
    figure = Figure(figsize=(8.0, 9.5), layout="constrained")
    figure.suptitle(
        "store -o slot=B2 -o pick_up=pick-up: the tool's way, and the arm at three instants", x=0.01, ha="left"
    )
    heights_mm = [high - low for low, high in _UP_MM.values()]
    for axes, (title, across, up) in zip(figure.subplots(2, 1, height_ratios=heights_mm), _SHELF_VIEWS, strict=True):
        _draw_boxes(axes, robot, shelf, across, up)
        _draw_motion(axes, robot, motion, across, up)
        axes.set_title(title, loc="left")
        axes.set_ylabel(f"{'xyz'[up]} [mm]")
        axes.set(xlim=_ACROSS_MM, ylim=_UP_MM[up], aspect="equal")
    figure.axes[-1].set_xlabel("x [mm]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=4)
    return figure


def _draw_boxes(axes: Axes, robot: Robot, shelf: Shelf, across: int, up: int) -> None:
    slot_of = {drawer: slot for slot, drawer in shelf.slots.items()}
    for name, box in robot.boxes.items():
        ends_mm = box.x_mm, box.y_mm, box.z_mm
        (left, right), (low, high) = ends_mm[across], ends_mm[up]
        color = _DRAWER if name in slot_of else _SHELF if name in shelf.obstacles else _TABLE
        axes.add_patch(
            Rectangle((left, low), right - left, high - low, facecolor=color, edgecolor="0.4", linewidth=0.6)
        )
        middle = (left + right) / 2, (low + high) / 2
        if up == 2 and name in slot_of:
            axes.annotate(slot_of[name], middle, ha="center", va="center")
    for name, spot in shelf.spots.items():
        axes.annotate(name, (spot.lid_mm[across], spot.lid_mm[up] - 70.0), ha="center", va="top", fontsize=8)


def _draw_motion(axes: Axes, robot: Robot, motion: Motion, across: int, up: int) -> None:
    kinematics = make_kinematics(robot)
    poses = kinematics.forward(motion.positions(np.linspace(0.0, motion.duration_s, 4000)))
    axes.plot(poses[:, across], poses[:, up], color=_PATH, linewidth=1.2, label="tip of the tool")
    instants = {"above the box": 0.0, "locked on": _switched_s(motion, 1), "drawer open": _switched_s(motion, 2)}
    for (label, at_s), style in zip(instants.items(), ("-", "--", ":"), strict=True):
        for number, points_mm in enumerate(_arm_mm(robot, motion.positions(np.array([at_s])))):
            axes.plot(
                points_mm[:, across],
                points_mm[:, up],
                style,
                color=_ARM,
                linewidth=2.5,
                marker="o",
                markersize=3,
                label=f"arm {label}" if number == 0 else None,
            )


def _arm_mm(robot: Robot, joints: FloatArray) -> list[FloatArray]:
    links = make_kinematics(robot).links(joints)
    return [
        link.points_mm[0]
        for link in links
        if link.role in (Role.LINK, Role.TOOL) and link.name not in ("hand", "bracket")
    ]


def _switched_s(motion: Motion, number: int) -> float:
    return motion.output_changes[number].from_s
