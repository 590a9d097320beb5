"""Make signals of a run's evidence, and the window that shows all of it."""

from collections.abc import Iterator, Sequence

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.waveforms.bus_states import STATES
from steptwin.host.record.waveforms.signal import HeldValues, Pulses, Signal, SignalKind
from steptwin.host.record.waveforms.timebase import Window
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AxisEvidence, Evidence, motor_moves

_LOGIC_PINS = ("enable", "reset", "out1", "out2")
_MODE_PINS = ("m1", "m2", "tq1", "tq2", "dcy1", "dcy2")


def wires(evidence: Evidence) -> list[Signal]:
    """Return STEP, DIR, ENABLE, RESET and both outputs of each axis."""
    return [signal for axis in evidence.axes for signal in _wires(axis, _LOGIC_PINS)]


def pins(evidence: Evidence) -> list[Signal]:
    """Return every pin of each axis."""
    return [signal for axis in evidence.axes for signal in _wires(axis, _LOGIC_PINS + _MODE_PINS)]


def everything(evidence: Evidence, robot: Robot, states: Sequence[HeldValues]) -> list[Signal]:
    """Return for each axis the board's pins, the drive's state, the driver's count and phases, the joint's position."""
    return [
        signal
        for i, (axis, joint, state) in enumerate(zip(evidence.axes, robot.joints, states, strict=True))
        for signal in (
            *_wires(axis, _LOGIC_PINS + _MODE_PINS),
            Signal(axis.name, "drive_state", SignalKind.TEXT, state, STATES),
            Signal(axis.name, "steps", SignalKind.REAL, _count(axis)),
            Signal(axis.name, f"position_{joint.unit}", SignalKind.REAL, _position(evidence, robot, i)),
            *phases(axis),
        )
    ]


def whole_record(evidence: Evidence) -> Window:
    """Return the window from power-up to the last edge of any pin."""
    last_counts = max(axis.last_counts for axis in evidence.axes)
    return Window(0, max(evidence.start_counts, last_counts), evidence.start_counts)


def _wires(axis: AxisEvidence, pins: Sequence[str]) -> Iterator[Signal]:
    yield Signal(axis.name, "step", SignalKind.WIRE, Pulses(axis.clk_rise_counts, axis.clk_fall_counts))
    yield Signal(axis.name, "dir", SignalKind.WIRE, HeldValues(axis.dir_edge_counts, axis.dir_levels))
    for pin in pins:
        edges = axis.pins[pin]
        yield Signal(axis.name, pin, SignalKind.WIRE, HeldValues(edges.counts, edges.levels))


def _count(axis: AxisEvidence) -> HeldValues:
    """Return the driver's count."""
    start = axis.start_steps
    return HeldValues(axis.step_counts, start + np.cumsum(axis.step_signs, dtype=np.int64), start)


def _position(evidence: Evidence, robot: Robot, joint: int) -> HeldValues:
    """Return a joint's position, which changes with the steps of every axis on which it depends."""
    elements = robot.coupling.axes_of(joint)
    motors = {i: _motor_position(evidence.axes[i], robot.joints[i]) for i in elements}
    counts = np.unique(np.concatenate([evidence.axes[i].step_counts for i in elements]))
    position, start = np.zeros(counts.size), 0.0
    for i, element in elements.items():
        made = np.searchsorted(evidence.axes[i].step_counts, counts, side="right")
        position += element * motors[i][made]
        start += element * float(motors[i][0])
    return HeldValues(counts, position, start)


def _motor_position(axis: AxisEvidence, joint: Joint) -> FloatArray:
    """Return the axis position before the first step and after each, in mm or degrees."""
    moves = np.cumsum(motor_moves(axis, joint.transmission.microsteps))
    return np.asarray((axis.start_steps + np.concatenate(([0], moves))) / joint.transmission.steps_per_unit)


def phases(axis: AxisEvidence) -> Iterator[Signal]:
    """Yield the field's electrical angle, 360 deg in four full steps, and the currents that the driver regulates to."""
    set_at = axis.phases
    angle_deg = set_at.sixteenths * (90.0 / 16.0)
    yield Signal(axis.name, "angle_deg", SignalKind.REAL, HeldValues(set_at.counts, angle_deg))
    yield Signal(axis.name, "phase_a_ma", SignalKind.REAL, HeldValues(set_at.counts, set_at.a_ma))
    yield Signal(axis.name, "phase_b_ma", SignalKind.REAL, HeldValues(set_at.counts, set_at.b_ma))
