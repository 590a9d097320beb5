"""Draw where each motor resonates: speed across, the driver's microstep settings up, the load angle as colour."""

from importlib.util import find_spec
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import LIMIT, new_figure, write_inside
from steptwin.host.studies.motors.fitting import natural_hz
from steptwin.host.studies.motors.resonance import SETTINGS, Electrics, resonance_map
from steptwin.host.twin.motors import MotorRun
from steptwin.host.twin.motors.drives import drive_of
from steptwin.host.twin.motors.poses import carried_inertias
from steptwin.host.verify import RunInfo

_ROW_INCHES: Final = 1.9
_COLUMNS: Final = 2
_RATES: Final = 32
_RANGE: Final = 60.0
"""Ratio of the highest speed to the lowest."""
_SLOWEST_HZ: Final = 4.0
_BEYOND: Final = 1.4
"""Part by which the highest speed is beyond the run's and beyond full steps at the natural frequency."""
_INSTANTS: Final = 25
_WORST_DEG: Final = 120.0


def draw_resonance(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw a panel for each joint that moves, with the inertia that is the greatest in the run."""
    moving = [axis for axis in range(len(ran.verdict.joints)) if ran.torques.rpm[:, axis].any()]
    rows = max(-(-len(moving) // _COLUMNS), 1)
    figure = new_figure(run, "resonance of the motors at steady speeds", _ROW_INCHES * rows)
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    if not find_spec("numba"):
        moving = []
        write_inside(grid[0], "needs numba: plain Python would take an hour")
    inertias = _greatest_inertias(ran)
    shown = None
    for place, axes in enumerate(grid):
        if place < len(moving):
            shown = _draw_joint(axes, ran, moving[place], inertias[moving[place]])
        elif place or moving:
            axes.set_axis_off()
    if shown is not None:
        figure.colorbar(shown, ax=grid.tolist(), label="greatest load angle [deg]", extend="max", pad=0.01)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


def _greatest_inertias(ran: MotorRun) -> FloatArray:
    """Return each axis' greatest inertia in the run, without the rotor's own."""
    instants = np.linspace(0, len(ran.paths.t_s) - 1, _INSTANTS).astype(np.int64)
    first = int(np.searchsorted(ran.trace.counts, ran.driving.start_counts))
    positions = ran.trace.positions[np.minimum(first + instants, len(ran.trace.positions) - 1)]
    robot = ran.driving.robot
    inertias = carried_inertias(robot, ran.driving.arms[1], robot.coupling.to_joints(positions))
    return np.asarray(np.diagonal(inertias, axis1=1, axis2=2).max(axis=0))


def _draw_joint(axes: Axes, ran: MotorRun, axis: int, inertia_kgm2: float) -> Any:
    joint, record = ran.driving.robot.joints[axis], ran.driving.drivers[axis]
    drive = drive_of(joint)
    rpm = np.abs(ran.torques.rpm[:, axis])
    full_steps = joint.transmission.full_steps_per_rev
    own_hz = rpm[rpm > 0.01 * rpm.max()] / 60.0 * full_steps
    natural = natural_hz(drive, record.phase_current_a, inertia_kgm2)
    fastest_hz = _BEYOND * max(natural, float(own_hz.max()), _SLOWEST_HZ)
    rates_hz = np.geomspace(max(fastest_hz / _RANGE, _SLOWEST_HZ), fastest_hz, _RATES)
    electrics = Electrics(record.phase_current_a, record.fast_decay, ran.verdict.supply_v_min)
    found = resonance_map(drive, inertia_kgm2, electrics, rates_hz)
    rows = np.arange(len(SETTINGS) + 1) - 0.5
    edges_hz = np.concatenate([rates_hz[:1], np.sqrt(rates_hz[1:] * rates_hz[:-1]), rates_hz[-1:]])
    mesh = axes.pcolormesh(edges_hz, rows, found.load_deg, cmap="viridis", vmin=0.0, vmax=_WORST_DEG)
    row, column = np.nonzero(found.slips)
    axes.plot(rates_hz[column], row, "x", color=LIMIT, markersize=5, label="loses steps")
    axes.plot(
        [natural / microsteps for microsteps in SETTINGS], range(len(SETTINGS)), "o", color="white", markersize=5,
        markeredgecolor="black", zorder=3, label="microsteps at the natural frequency",
    )  # fmt: skip
    own_row = SETTINGS.index(joint.transmission.microsteps)
    axes.plot(
        [own_hz.min(), own_hz.max()], [own_row, own_row], color="black", linewidth=2.0, marker="|", markersize=10,
        label="speeds of the run",
    )  # fmt: skip
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(rates_hz[0], rates_hz[-1])
    axes.set_ylim(rows[0], rows[-1])
    axes.set_yticks(range(len(SETTINGS)), [f"1/{microsteps}" if microsteps > 1 else "1" for microsteps in SETTINGS])
    axes.grid(visible=False)
    axes.set_xlabel("full steps a second")
    axes.set_title(f"{joint.name}: {drive.motor.name}, natural frequency {natural:.0f} Hz", loc="left")
    return mesh
