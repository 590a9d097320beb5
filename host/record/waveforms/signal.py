"""Make the signals of a run's evidence, the window of a file, and its time scale.

Signals are read in stretches, which bounds the memory.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.record.bus_log import read_frames
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AxisEvidence, Evidence, motor_moves
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_TPDO, FIRST_NODE_ID
from steptwin.protocol.objects import ENTRIES, TPDO_DEFAULTS
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Unit of the instants in a file; instants are rounded to the nearest unit.

    A number of units equals a number of counts exactly: 5 units of 100 ns are 36 counts of 72 MHz.

    Attributes:
        vcd: the unit in the syntax of VCD files.
        units: number of units in `counts` counts.
        counts: number of counts of 72 MHz in `units` units.
    """

    vcd: str
    units: int
    counts: int

    def rounded(self, counts: Int64Array) -> Int64Array:
        """Return instants in units; half a unit is rounded up."""
        units: Int64Array = (2 * self.units * counts + self.counts) // (2 * self.counts)
        return units

    def unit(self, counts: int) -> int:
        """Return one instant in units."""
        return int(self.rounded(np.array([counts], dtype=np.int64))[0])

    def last_counts(self, unit: int) -> int:
        """Return the last count that is rounded to `unit` or to an earlier one."""
        return -(-self.counts * (2 * unit + 1) // (2 * self.units)) - 1


SCALES: Final = {
    "1us": TimeScale("1 us", 1, 72),
    "100ns": TimeScale("100 ns", 5, 36),
    "10ns": TimeScale("10 ns", 25, 18),
}
"""Time scales by name on the command line, the coarsest first: sigrok's time and memory for a file grow with the units
in it, not with the changes. A count lasts 13.9 ns: at 10 ns no two counts share a unit.
"""

COUNTS: Final = TimeScale("", 1, 1)
"""The scale without rounding."""

NANOSECONDS: Final = TimeScale("1 ns", 125, 9)


@dataclass(frozen=True, slots=True)
class Window:
    """Part of a record in a file, in counts since power-up.

    Attributes:
        from_counts: start; a change at this instant is part of the initial values.
        to_counts: end; a change at this instant is included.
        start_counts: instant of the motion's t = 0.
    """

    from_counts: int
    to_counts: int
    start_counts: int

    def time_s(self, counts: int) -> float:
        """Return an instant in the motion's time."""
        return (counts - self.start_counts) / COUNTS_PER_SECOND

    def counts(self, t_s: float) -> int:
        """Return an instant of the motion's time in counts."""
        return self.start_counts + round(t_s * COUNTS_PER_SECOND)


Values = NDArray[Any]

NO_COUNTS = np.empty(0, np.int64)
_NEVER_COUNTS: Final = (1 << 63) - 1

CHANGES_PER_STRETCH = 1 << 16
"""Number of changes of one signal that are converted to text at once."""


class SignalKind(Enum):
    """Kind of a signal's values."""

    WIRE = "wire"
    """0 or 1."""
    REAL = "real"
    """A number."""
    TEXT = "text"
    """An index into the signal's texts."""


class Changes(Protocol):
    """Changes of a signal in order of time."""

    def at(self, counts: int) -> int | float:
        """Return the value at an instant, after any change at it."""
        ...

    def between(self, after: int, until: int) -> tuple[Int64Array, Values]:
        """Return each instant with changes in (after, until], and the value after it."""
        ...

    def before(self, counts: int) -> int | None:
        """Return the instant of the last change before an instant; None if there is none."""
        ...

    def after(self, counts: int) -> int | None:
        """Return the instant of the first change after an instant; None if there is none."""
        ...

    def marks(self, every: int) -> Int64Array:
        """Return instants with at most `every` changes between two of them."""
        ...


@dataclass(frozen=True, slots=True)
class HeldValues:
    """Values from an instant on; implements Changes.

    Attributes:
        counts: shape (n,), the instants, sorted.
        values: shape (n,), value from each instant on.
        initial: value before the first instant.
    """

    counts: Int64Array
    values: Values
    initial: int | float = 0

    def at(self, counts: int) -> int | float:
        """As Changes.at."""
        return self._after(int(np.searchsorted(self.counts, counts, side="right")))

    def between(self, after: int, until: int) -> tuple[Int64Array, Values]:
        """As Changes.between; a repeated value does not count as a change."""
        first, last = np.searchsorted(self.counts, (after, until), side="right").tolist()
        counts, values = self.counts[first:last], self.values[first:last]
        final = np.append(counts[1:] != counts[:-1], True) if counts.size else np.empty(0, np.bool_)
        counts, values = counts[final], values[final]
        changed = values != np.concatenate([[self._after(first)], values[:-1]])[: values.size]
        return counts[changed], values[changed]

    def before(self, counts: int) -> int | None:
        """As Changes.before."""
        instants, _ = self.between(-1, counts - 1)
        return int(instants[-1]) if instants.size else None

    def after(self, counts: int) -> int | None:
        """As Changes.after."""
        instants, _ = self.between(counts, _NEVER_COUNTS)
        return int(instants[0]) if instants.size else None

    def marks(self, every: int) -> Int64Array:
        """As Changes.marks."""
        return self.counts[every::every]

    def _after(self, changes: int) -> int | float:
        """Return the value after a number of changes."""
        value: int | float = self.values[changes - 1].item() if changes else self.initial
        return value


@dataclass(frozen=True, slots=True)
class Pulses:
    """A pin that is low at first and has pulses; implements Changes. Both arrays have shape (pulses,)."""

    rise_counts: Int64Array
    fall_counts: Int64Array

    def at(self, counts: int) -> int:
        """As Changes.at."""
        begun, ended = (np.searchsorted(edges, counts, side="right") for edges in (self.rise_counts, self.fall_counts))
        return int(begun - ended)

    def between(self, after: int, until: int) -> tuple[Int64Array, Values]:
        """As Changes.between."""
        first = int(np.searchsorted(self.fall_counts, after, side="right"))
        last = int(np.searchsorted(self.rise_counts, until, side="right"))
        counts = np.column_stack([self.rise_counts[first:last], self.fall_counts[first:last]]).ravel()
        levels = np.tile(np.array([1, 0], np.int8), last - first)
        inside = (counts > after) & (counts <= until)
        return counts[inside], levels[inside]

    def before(self, counts: int) -> int | None:
        """As Changes.before."""
        made = int(np.searchsorted(self.rise_counts, counts, side="left"))
        if not made:
            return None
        fall = int(self.fall_counts[made - 1])
        return fall if fall < counts else int(self.rise_counts[made - 1])

    def after(self, counts: int) -> int | None:
        """As Changes.after."""
        ended = int(np.searchsorted(self.fall_counts, counts, side="right"))
        if ended == self.fall_counts.size:
            return None
        rise = int(self.rise_counts[ended])
        return rise if rise > counts else int(self.fall_counts[ended])

    def marks(self, every: int) -> Int64Array:
        """As Changes.marks."""
        return self.rise_counts[every // 2 :: every // 2]


@dataclass(frozen=True, slots=True)
class Signal:
    """One line of a waveform.

    Attributes:
        axis: name of the axis, which is the joint's.
        quantity: name of the axis' pin or quantity, such as `step` or `position_deg`.
        kind: kind of the values.
        changes: the values over time.
        texts: texts for the values of a text signal.
    """

    axis: str
    quantity: str
    kind: SignalKind
    changes: Changes
    texts: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name in files: letters, digits and underscores only."""
        return f"{self.scope}_{self.quantity}"

    @property
    def scope(self) -> str:
        """Name of the axis in files."""
        return re.sub(r"[^A-Za-z0-9_]", "_", self.axis)


def stretches(signals: Sequence[Signal], window: Window, scale: TimeScale) -> Iterator[tuple[int, int]]:
    """Yield pieces (after, until] of the window with at most CHANGES_PER_STRETCH changes of each signal.

    No piece ends within a unit of the scale.
    """
    marks = [signal.changes.marks(CHANGES_PER_STRETCH) for signal in signals]
    ends = {scale.last_counts(unit) for unit in scale.rounded(np.concatenate([NO_COUNTS, *marks])).tolist()}
    inside = sorted(end for end in ends if window.from_counts < end < window.to_counts)
    yield from pairwise([window.from_counts, *inside, window.to_counts])


STATES: Final = ("UNKNOWN", *(state.name for state in State))
"""Names of the values; a drive's state is unknown before its first PDO."""

_PDO_BYTES: Final = sum(ENTRIES[address].data_type.size for address in TPDO_DEFAULTS[0].mapping)


def drive_states(log: Path, axes: int, frames: int | None = None) -> tuple[HeldValues, ...]:
    """Return the state of each axis' drive over time; its instants are those of the log, in whole microseconds.

    `frames` limits the number of frames that are read.

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
    """Return the index of the state; a statusword without a state is unknown."""
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
    """Return for each axis its pins, drive state, driver's count, phases and joint position."""
    return [
        signal
        for i, (axis, joint, state) in enumerate(zip(evidence.axes, robot.axes, states, strict=True))
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


def _position(evidence: Evidence, robot: Robot, axis: int) -> HeldValues:
    """Return the position of an axis' joint, which changes with the steps of all axes that move it.

    For a second motor's axis, it is the position of its end of the joint.
    """
    of_joint = axis == robot.coupling.joint_of(axis)
    elements = robot.coupling.axes_of(axis) if of_joint else robot.coupling.travel_of(axis)
    motors = {i: _motor_position(evidence.axes[i], robot.axes[i]) for i in elements}
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
    """Yield the field's electrical angle, 360 deg in four full steps, and the regulated currents."""
    set_at = axis.phases
    angle_deg = set_at.substeps * (90.0 / set_at.per_full_step)
    yield Signal(axis.name, "angle_deg", SignalKind.REAL, HeldValues(set_at.counts, angle_deg))
    yield Signal(axis.name, "phase_a_ma", SignalKind.REAL, HeldValues(set_at.counts, set_at.a_ma))
    yield Signal(axis.name, "phase_b_ma", SignalKind.REAL, HeldValues(set_at.counts, set_at.b_ma))
