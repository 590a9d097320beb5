"""Make signals of a run's evidence, and the window that shows all of it."""

from collections.abc import Iterator, Sequence

import numpy as np

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


def everything(evidence: Evidence, robot: Robot, states: Sequence[HeldValues]) -> list[Signal]:
    """Return for each axis the board's pins, the drive's state, the driver's count and phases, the joint's position."""
    return [
        signal
        for axis, joint, state in zip(evidence.axes, robot.joints, states, strict=True)
        for signal in (
            *_wires(axis, _LOGIC_PINS + _MODE_PINS),
            Signal(axis.name, "drive_state", SignalKind.TEXT, state, STATES),
            *_positions(axis, joint),
            *_phases(axis),
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


def _positions(axis: AxisEvidence, joint: Joint) -> Iterator[Signal]:
    """Yield the driver's count and the joint's position by that count."""
    start, counts = axis.start_steps, axis.step_counts
    steps = start + np.cumsum(axis.step_signs, dtype=np.int64)
    spu = joint.transmission.steps_per_unit
    positions = (start + np.cumsum(motor_moves(axis, joint.transmission.microsteps))) / spu
    yield Signal(axis.name, "steps", SignalKind.REAL, HeldValues(counts, steps, start))
    yield Signal(axis.name, f"position_{joint.unit}", SignalKind.REAL, HeldValues(counts, positions, start / spu))


def _phases(axis: AxisEvidence) -> Iterator[Signal]:
    """Yield the field's electrical angle, 360 deg in four full steps, and the currents that the driver regulates to."""
    phases = axis.phases
    angle_deg = phases.sixteenths * (90.0 / 16.0)
    yield Signal(axis.name, "angle_deg", SignalKind.REAL, HeldValues(phases.counts, angle_deg))
    yield Signal(axis.name, "phase_a_ma", SignalKind.REAL, HeldValues(phases.counts, phases.a_ma))
    yield Signal(axis.name, "phase_b_ma", SignalKind.REAL, HeldValues(phases.counts, phases.b_ma))
