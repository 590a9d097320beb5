"""Make signals of a run's evidence, and the window that shows all of it."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.record.bus_log import read_frames
from steptwin.host.record.waveforms.signal import HeldValues, Pulses, Signal, SignalKind, Window
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AxisEvidence, Evidence, motor_moves
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_TPDO, FIRST_NODE_ID
from steptwin.protocol.objects import ENTRIES, TPDO_DEFAULTS

STATES: Final = ("UNKNOWN", *(state.name for state in State))
"""Names of the values; a drive's state is unknown before its first PDO."""

_PDO_BYTES: Final = sum(ENTRIES[address].data_type.size for address in TPDO_DEFAULTS[0].mapping)


def drive_states(log: Path, axes: int, frames: int | None = None) -> tuple[HeldValues, ...]:
    """Return the state of each axis' drive over time; its instants are those of the log, in whole microseconds.

    With `frames`, only so many frames of the log are read.

    Raises:
        InputError: a line is not in candump's format (the message names file and line), or the lines are not in order.
    """
    changes: list[list[tuple[int, int]]] = [[] for _ in range(axes)]
    last_counts = 0
    for counts, (cob_id, data) in read_frames(log, frames):
        if counts < last_counts:
            raise InputError(f"{log}: the instants are not in order of time")
        last_counts = counts
        axis = cob_id - COB_TPDO[0] - FIRST_NODE_ID
        if 0 <= axis < axes and len(data) == _PDO_BYTES:
            changes[axis].append((counts, _state(int.from_bytes(data[:2], "little"))))
    return tuple(_held(own) for own in changes)


def _state(statusword: int) -> int:
    """Return the index of the state; a statusword that matches no state is unknown."""
    try:
        return STATES.index(State.of(statusword).name)
    except ValueError:
        return 0


def _held(changes: Sequence[tuple[int, int]]) -> HeldValues:
    counts, states = zip(*changes, strict=True) if changes else ((), ())
    return HeldValues(np.array(counts, np.int64), np.array(states, np.int8))


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
