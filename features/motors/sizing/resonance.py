"""Find and draw the resonances of a motor: the greatest load angle at steady speeds, by microstep setting."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from math import ceil, inf
from typing import Any, Final, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.features.motors.rotors.arm import BASE, Arm, Body
from steptwin.features.motors.rotors.rotor_kernel import DT_COUNTS, DT_S
from steptwin.features.motors.rotors.rotors import Drive, DriverEvents, Rotors
from steptwin.features.motors.sizing.fitting import natural_hz
from steptwin.features.motors.turning import MotorRun
from steptwin.features.motors.turning.drives import drive_of
from steptwin.features.motors.turning.poses import carried_inertias
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.record.plots.canvas import LIMIT, Sheet, write_inside

SETTINGS: Final = (1, 2, 8, 16)
"""Compared microsteps for each full step: those of a TB6560; a run's own setting is added."""
_RAMP_MS_MIN: Final = 100
"""Least duration of the motor's run-up, with a field that turns smoothly and excites no oscillation."""
_RAMP_TORQUE: Final = 0.3
"""Fraction of the motor's torque that the run-up may use."""
_SETTLING_MS: Final = 80
"""Time at the steady speed before the oscillation is measured."""
_MEASURED_MS_MIN: Final = 120
_MEASURED_FULL_STEPS: Final = 2.0
"""Full steps for which the oscillation is measured at least."""
_EVERY_STEPS: Final = 5
"""Steps of integration between two changes of the smooth field."""


@dataclass(frozen=True, slots=True)
class Electrics:
    """Supply of the motor: current amplitude, fraction of fast decay, voltage."""

    current_a: float
    fast_decay: float
    volt: float


@dataclass(frozen=True, slots=True, eq=False)
class ResonanceMap:
    """Load angles at steady speeds.

    Attributes:
        rates_hz: shape (n,), speeds in full steps a second.
        load_deg: shape (settings, n), the greatest load angle, electrical degrees.
        slips: shape (settings, n), True where the motor loses steps.
    """

    rates_hz: FloatArray
    load_deg: FloatArray
    slips: BoolArray


def resonance_map(
    drive: Drive,
    inertia_kgm2: float,
    electrics: Electrics,
    rates_hz: FloatArray,
    settings: Sequence[int] = SETTINGS,
) -> ResonanceMap:
    """Turn a motor with a wheel on its shaft at each speed in each setting; no load brakes the wheel."""
    drive = replace(drive, lower_rad=-inf, upper_rad=inf)
    load_deg = np.zeros((len(settings), len(rates_hz)))
    slips = np.zeros(load_deg.shape, dtype=np.bool_)
    for column, rate_hz in enumerate(rates_hz.tolist()):
        times = _Times.of(drive, inertia_kgm2, electrics, rate_hz)
        for row, microsteps in enumerate(settings):
            rotors = Rotors([drive], wheel(inertia_kgm2), PowerSupply(electrics.volt), [0.0])
            rotors.feed([_field(rate_hz, microsteps, electrics, times)])
            record = rotors.advance(times.total_ms)
            measured = slice(-times.measured_ms, None)
            load_deg[row, column] = np.rad2deg(np.abs(record.worst_rad[measured, 0]).max())
            slips[row, column] = np.ptp(record.lost_full_steps[measured, 0]) > 0.0
    return ResonanceMap(rates_hz, load_deg, slips)


def wheel(inertia_kgm2: float) -> Arm:
    """Return a wheel on a motor's shaft."""
    body = Body(BASE, False, np.eye(4), 0.0, np.zeros(3), np.diag([0.0, 0.0, inertia_kgm2]))
    return Arm((body,), np.eye(1), np.zeros(1))


class _Times(NamedTuple):
    """Parts of one trial: run-up, settling, measurement."""

    ramp_ms: int
    measured_ms: int

    @classmethod
    def of(cls, drive: Drive, inertia_kgm2: float, electrics: Electrics, rate_hz: float) -> Self:
        """Return sufficient times for a motor with its wheel and a speed."""
        motor = drive.motor
        rad_s = 2.0 * np.pi * rate_hz / motor.full_steps_per_rev
        torque_nm = _RAMP_TORQUE * motor.torque_constant_nm_a * electrics.current_a
        ramp_s = np.pi / 2.0 * rad_s * (motor.rotor_inertia_kgm2 + inertia_kgm2) / torque_nm
        measured_s = _MEASURED_FULL_STEPS / rate_hz
        return cls(max(ceil(1000.0 * ramp_s), _RAMP_MS_MIN), max(ceil(1000.0 * measured_s), _MEASURED_MS_MIN))

    @property
    def total_ms(self) -> int:
        return self.ramp_ms + _SETTLING_MS + self.measured_ms


def _field(rate_hz: float, microsteps: int, electrics: Electrics, times: _Times) -> DriverEvents:
    """Return a field that turns smoothly up to its speed and goes on in microsteps."""
    ramp_s = times.ramp_ms / 1000.0
    smooth_steps = np.arange(0, round(ramp_s / DT_S), _EVERY_STEPS)
    part = smooth_steps * DT_S / ramp_s
    # The speed rises as (1 - cos) / 2, which goes half as far as the full speed would.
    smooth = rate_hz * ramp_s * (part / 2.0 - np.sin(np.pi * part) / (2.0 * np.pi))
    rate_made_hz = rate_hz * microsteps
    made = rate_made_hz * ramp_s / 2.0
    number = np.arange(1, int(rate_made_hz * (times.total_ms - times.ramp_ms) / 1000.0) + 1)
    first = np.floor(made) + number
    step_s = ramp_s + (first - made) / rate_made_hz
    counts = np.concatenate([smooth_steps, np.rint(step_s / DT_S).astype(np.int64)]) * DT_COUNTS
    angle = np.pi / 2.0 * np.concatenate([smooth, first / microsteps])
    one, current_a = np.ones(angle.size), electrics.current_a
    return DriverEvents(
        counts, angle, current_a * np.cos(angle), current_a * np.sin(angle), electrics.fast_decay * one, one
    )


_SCALE_INCHES: Final = 1.0
"""Width of the colour scale on the right."""
_RATES: Final = 32
_RANGE: Final = 60.0
"""Ratio of the highest speed to the lowest."""
_SLOWEST_HZ: Final = 4.0
_BEYOND: Final = 1.4
"""Factor of the highest speed over the run's, and over full steps at the natural frequency."""
_INSTANTS: Final = 25
_WORST_DEG: Final = 120.0


def draw_motor_resonance(sheet: Sheet, ran: MotorRun) -> None:
    """Draw a panel for each joint that moves, with its greatest inertia in the run."""
    moving = [axis for axis in range(len(ran.verdict.joints)) if ran.torques.rpm[:, axis].any()]
    rows = sheet.panels(max(-(-len(moving) // 2), 1), band_lines=2, right_inches=_SCALE_INCHES, share="none")
    cells = [axes for row in rows for axes in row]
    if not find_spec("numba"):
        moving = []
        write_inside(cells[0], "needs numba: plain\nPython would take an hour")
    inertias = _greatest_inertias(ran)
    shown = [_draw_joint(axes, ran, axis, inertias[axis]) for axes, axis in zip(cells, moving, strict=False)]
    for axes in cells[max(len(moving), 1) :]:
        axes.remove()
    if shown:
        first = cells[0].get_position()
        scale = sheet.figure.add_axes((0.9, first.y0, 0.02, first.height))
        sheet.figure.colorbar(shown[0], cax=scale, label="load angle [deg]", extend="max")
        sheet.legend(cells[0], 2)


def _greatest_inertias(ran: MotorRun) -> FloatArray:
    """Return each axis' greatest inertia in the run without the rotor's own."""
    instants = np.linspace(0, len(ran.paths.t_s) - 1, _INSTANTS).astype(np.int64)
    first = int(np.searchsorted(ran.trace.counts, ran.driving.start_counts))
    positions = ran.trace.positions[np.minimum(first + instants, len(ran.trace.positions) - 1)]
    robot = ran.driving.robot
    inertias = carried_inertias(robot, ran.driving.arms[1], robot.coupling.to_joints(positions))
    return np.asarray(np.diagonal(inertias, axis1=1, axis2=2).max(axis=0))


def _draw_joint(axes: Axes, ran: MotorRun, axis: int, inertia_kgm2: float) -> Any:
    joint, record = ran.driving.robot.axes[axis], ran.driving.drivers[axis]
    drive = drive_of(joint, ran.driving.chip)
    rpm = np.abs(ran.torques.rpm[:, axis])
    full_steps = joint.transmission.full_steps_per_rev
    own_hz = rpm[rpm > 0.01 * rpm.max()] / 60.0 * full_steps
    natural = natural_hz(drive, record.phase_current_a, inertia_kgm2)
    fastest_hz = _BEYOND * max(natural, float(own_hz.max()), _SLOWEST_HZ)
    rates_hz = np.geomspace(max(fastest_hz / _RANGE, _SLOWEST_HZ), fastest_hz, _RATES)
    electrics = Electrics(record.phase_current_a, record.fast_decay, ran.verdict.supply_v_min)
    settings = sorted({*SETTINGS, joint.transmission.microsteps})
    found = resonance_map(drive, inertia_kgm2, electrics, rates_hz, settings)
    rows = np.arange(len(settings) + 1) - 0.5
    edges_hz = np.concatenate([rates_hz[:1], np.sqrt(rates_hz[1:] * rates_hz[:-1]), rates_hz[-1:]])
    mesh = axes.pcolormesh(edges_hz, rows, found.load_deg, cmap="viridis", vmin=0.0, vmax=_WORST_DEG)
    row, column = np.nonzero(found.slips)
    axes.plot(rates_hz[column], row, "x", color=LIMIT, markersize=5, label="loses steps")
    axes.plot(
        [natural / microsteps for microsteps in settings], range(len(settings)), "o", color="white", markersize=5,
        markeredgecolor="black", zorder=3, label="microsteps at the natural frequency, which the title states",
    )  # fmt: skip
    own_row = settings.index(joint.transmission.microsteps)
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
    axes.set_yticks(range(len(settings)), [f"1/{microsteps}" if microsteps > 1 else "1" for microsteps in settings])
    axes.grid(visible=False)
    axes.set_xlabel("full steps a second")
    axes.set_title(f"{joint.name}: {drive.motor.name}, {natural:.0f} Hz", loc="left", size=9.5)
    return mesh
