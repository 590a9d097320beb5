"""The rotors of all axes of a machine, turned by the drivers' currents.

A driver counts steps whether or not the rotor follows. This model turns the rotors by the phase currents of the drivers
and by the masses on them. It gives each rotor's lag behind its field, and its slips.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import exp, inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from steptwin.controller.motion.kernel import TICKS_PER_MS
from steptwin.emulator.board.edges import FloatArray, Int64Array
from steptwin.emulator.drivers.power_supply import GIVEN_J, HIGHEST_V, LOST_J, LOWEST_V, PowerSupply
from steptwin.features.motors.rotors import mechanics
from steptwin.features.motors.rotors import rotor_kernel as rk
from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.motor import FULL_STEPS_PER_TOOTH, Motor
from steptwin.features.motors.rotors.rotor_backend import (
    Numbers,
    RotorBackend,
    arm_arrays,
    body_numbers,
    fastest_rotors,
    joint_arrays,
)
from steptwin.features.motors.rotors.rotor_run import REFRESH_STEPS, TICK_STEPS


@dataclass(frozen=True, slots=True)
class Drive:
    """One motor and the transmission to its coordinate of the mechanism; torques are those at the rotor.

    Attributes:
        motor: the motor.
        bridge_ohm: both switches of the bridge and the sense resistor.
        current_max_a: highest current that the driver makes in a phase.
        friction_nm: Coulomb friction of motor and gear.
        efficiency: of the gear, 0 to 1; its losses add friction in proportion to the load.
        brake_nm: torque of a brake, which holds while the driver's outputs are off.
        stiffness_nm_rad: of a belt or shaft between rotor and coordinate; inf: stiff.
        damping_nm_s: of the same.
        lower_rad: rotor's angle at the lower end stop.
        upper_rad: likewise at the upper one.
        mounting_rad: electrical angle of the rotor where its coordinate is 0.

    ValueError: the efficiency is not above 0 and up to 1.
    """

    motor: Motor
    bridge_ohm: float
    current_max_a: float = 3.0
    friction_nm: float = 0.0
    efficiency: float = 1.0
    brake_nm: float = 0.0
    stiffness_nm_rad: float = inf
    damping_nm_s: float = 0.0
    lower_rad: float = -inf
    upper_rad: float = inf
    mounting_rad: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.efficiency <= 1.0:
            raise ValueError(f"efficiency: {self.efficiency:g} is not above 0 and up to 1")

    @property
    def most_nm(self) -> float:
        """Torque that the motor hardly ever exceeds: both phases at the driver's highest current, oscillating.

        An elastic belt passes on twice the torque of an impact.
        """
        elastic = 1.0 if self.stiffness_nm_rad == inf else 2.0
        return elastic * (
            sqrt(2.0) * self.current_max_a * self.motor.torque_constant_nm_a + self.motor.detent_torque_nm
        )

    def numbers(self) -> list[float]:
        """Return the drive as numbers for the kernel."""
        motor, resistance = self.motor, self.motor.resistance_ohm + self.bridge_ohm
        fall = exp(-resistance * rk.DT_S / motor.inductance_h)
        elastic = self.stiffness_nm_rad != inf
        capacity_j_k = motor.thermal_time_constant_s / motor.thermal_resistance_k_w
        values = {
            rk.TEETH: float(motor.teeth),
            rk.KM: motor.torque_constant_nm_a,
            rk.DRAG: motor.drag_nm_s,
            rk.DETENT: motor.detent_torque_nm,
            rk.RESISTANCE: resistance,
            rk.DECAY: fall,
            rk.MEAN: (1.0 - fall) * motor.inductance_h / (resistance * rk.DT_S),
            rk.WINDING_OHM: motor.resistance_ohm,
            rk.FRICTION: self.friction_nm,
            rk.BRAKE: self.brake_nm,
            rk.ELASTIC: float(elastic),
            rk.STIFFNESS: self.stiffness_nm_rad if elastic else 0.0,
            rk.DAMPING: self.damping_nm_s,
            rk.INERTIA: motor.rotor_inertia_kgm2,
            rk.LOWER: self.lower_rad,
            rk.UPPER: self.upper_rad,
            rk.HEATING: rk.DT_S / capacity_j_k,
            rk.COOLING: rk.DT_S / motor.thermal_time_constant_s,
            rk.SLIDING: 1.0 / self.efficiency - 1.0,
            rk.GAIN: resistance / (1.0 - fall),
            rk.CONDUCTANCE: 1.0 / resistance,
            rk.MOUNTING: self.mounting_rad,
        }
        return [values[field] for field in range(rk.AXIS_FIELDS)]


@dataclass(frozen=True, slots=True, eq=False)
class DriverEvents:
    """Changes at one driver's outputs, sorted by time; arrays of shape (n,).

    Attributes:
        counts: instants in counts of the timer.
        field_rad: electrical angle of the field, counted through; it grows with the position.
        a_amp: current to which phase A is regulated.
        b_amp: likewise of phase B; the rotor's angle grows from A to B.
        fast: fraction of fast decay, 0 to 1.
        on: 1 while the outputs are on, else 0.
    """

    counts: Int64Array
    field_rad: FloatArray
    a_amp: FloatArray
    b_amp: FloatArray
    fast: FloatArray
    on: FloatArray

    def numbers(self) -> FloatArray:
        """Return the events as numbers for the kernel, shape (n, EVENT_FIELDS)."""
        columns = (self.counts, self.field_rad, self.a_amp, self.b_amp, self.fast, self.on)
        return np.column_stack([np.asarray(column, dtype=np.float64) for column in columns])


@dataclass(frozen=True, slots=True, eq=False)
class RotorRecord:
    """The state of all axes at the end of each ms; arrays of shape (n, axes).

    Attributes:
        counts: shape (n,), the instants.
        rotor_rad: angle of each rotor, counted through.
        coordinate_rad: angle of the coordinate; differs from the rotor's by the twist of an elastic drive.
        worst_rad: load angle with the largest magnitude in that ms, in electrical rad, with sign.
        lost_full_steps: full steps between each rotor and its field; 4 for each slip.
        torque_nm: the motor's torque.
        warmer_k: temperature of the windings above ambient.
    """

    counts: Int64Array
    rotor_rad: FloatArray
    coordinate_rad: FloatArray
    worst_rad: FloatArray
    lost_full_steps: FloatArray
    torque_nm: FloatArray
    warmer_k: FloatArray


class Energies(NamedTuple):
    """Energy in J since the beginning, arrays of shape (axes,): input by the bridges, and its uses."""

    driven: FloatArray
    copper: FloatArray
    drag: FloatArray
    rubbed: FloatArray
    loaded: FloatArray


class Rotors:
    """All rotors of a machine, coupled by its arm; they begin at rest with currents off."""

    def __init__(
        self,
        drives: Sequence[Drive],
        arm: Arm,
        supply: PowerSupply,
        rotor_rad: Sequence[float],
        from_counts: int = 0,
        backend: RotorBackend | None = None,
        gravity_m_s2: float = mechanics.GRAVITY_M_S2,
    ) -> None:
        self._backend = backend or fastest_rotors()
        self._axes, bodies = len(drives), len(arm.bodies)
        numbers = self._backend.numbers
        self._teeth = [drive.motor.teeth for drive in drives]
        self._mounting_rad = [drive.mounting_rad for drive in drives]
        self._most_nm = np.array([drive.most_nm for drive in drives])
        at_rest = [value for drive, angle in zip(drives, rotor_rad, strict=True) for value in _rest(drive, angle)]

        def zeros(count: int) -> Numbers:
            return numbers([0.0] * count)

        self._arm = arm_arrays(arm, self._backend, gravity_m_s2)
        self._joints = joint_arrays(arm, self._backend)
        self._masses = mechanics.MassArrays(
            zeros=zeros(bodies),
            unit=zeros(bodies),
            torques=zeros(bodies),
            masses=zeros(bodies * bodies),
            matrix=zeros(self._axes * self._axes),
        )
        self._rotors = rk.RotorArrays(
            axes=numbers([value for drive in drives for value in drive.numbers()]),
            state=numbers(at_rest),
            inverse=zeros(self._axes * self._axes),
            bias=zeros(self._axes),
            forces=zeros(self._axes),
            supply=numbers(supply.numbers(rk.DT_S)),
        )
        self._rows = np.empty((0, rk.EVENT_FIELDS))
        """Events fed so far, axis after axis; `_events` holds them for the kernel."""
        nothing = [0] * self._axes
        self._events = rk.EventArrays(numbers([]), self._backend.indices(nothing), self._backend.indices(nothing))
        self._steps = 0
        self._began_counts = from_counts

    @property
    def counts(self) -> int:
        """Instant to which the rotors have turned."""
        return self._began_counts + self._steps * rk.DT_COUNTS

    def carry(self, arm: Arm) -> None:
        """Change the masses on the same joints from the next ms on: a payload is taken or left."""
        self._arm = self._arm._replace(bodies=body_numbers(arm, self._backend))

    def mount(self, axis: int, mounting_rad: float) -> None:
        """Set the electrical angle at which a rotor is mounted, before its outputs come on for the first time."""
        self._rotors.state[axis * rk.STATE_FIELDS + rk.ANGLE] += mounting_rad - self._mounting_rad[axis]
        self._rotors.axes[axis * rk.AXIS_FIELDS + rk.MOUNTING] = mounting_rad
        self._mounting_rad[axis] = mounting_rad

    def slip(self, axis: int, turns: int) -> None:
        """Turn a rotor and its coordinate by whole electrical turns at once."""
        x, by = axis * rk.STATE_FIELDS, 2.0 * pi * turns
        self._rotors.state[x + rk.ANGLE] += by
        self._rotors.state[x + rk.PLACE] += by / self._teeth[axis]
        self._rotors.state[x + rk.TURN] -= turns
        if self._rotors.state[x + rk.SLIP_STEP] < 0.0:
            self._rotors.state[x + rk.SLIP_STEP] = self._steps

    def coordinates_rad(self) -> list[float]:
        """Return the angle of each coordinate, as in `RotorRecord`."""
        return self._each(rk.PLACE)

    def rates_rad_s(self) -> list[float]:
        """Return the speed of each coordinate."""
        return self._each(rk.RATE)

    def lost_full_steps(self) -> list[float]:
        """Return the full steps between each rotor and its field, as in `RotorRecord`."""
        return [FULL_STEPS_PER_TOOTH * turns for turns in self._each(rk.TURN)]

    def accelerations_max_rad_s2(self) -> list[float]:
        """Return a rough upper limit of each coordinate's acceleration, at the masses of the present ms."""
        inverse = np.abs(np.array(self._rotors.inverse)).reshape(self._axes, self._axes)
        if not inverse.any():  # nothing has turned yet
            return [inf] * self._axes
        most: list[float] = (inverse @ (self._most_nm + np.abs(self._rotors.bias))).tolist()
        return most

    def feed(self, events: Sequence[DriverEvents]) -> None:
        """Add the next changes at each axis' driver. A change takes effect in the first step that is not before it."""
        self.feed_rows([axis.numbers() for axis in events])

    def feed_rows(self, events: Sequence[FloatArray]) -> None:
        """Add changes as numbers for the kernel, an array of shape (n, EVENT_FIELDS) for each axis."""
        parts = [
            part
            for first, end, new in zip(self._events.cursors, self._events.ends, events, strict=True)
            for part in (self._rows[first:end], new)
        ]
        lengths = list(accumulate(len(part) for part in parts))[1::2]
        self._rows = np.concatenate(parts)
        self._events = rk.EventArrays(
            rows=self._backend.rows(self._rows),
            ends=self._backend.indices(lengths),
            cursors=self._backend.indices([0, *lengths[:-1]]),
        )

    def advance(self, milliseconds: int) -> RotorRecord:
        """Turn the rotors, with the events fed so far; return their state at the end of each ms."""
        return self.advance_ticks(TICKS_PER_MS * milliseconds)

    def advance_ticks(self, ticks: int) -> RotorRecord:
        """Turn the rotors for some servo ticks; return their state at the end of each ms among them."""
        return self._record(self._advanced(ticks))

    def advancing(self, ticks: int) -> Generator[None, None, RotorRecord]:
        """Turn the rotors in pieces that end with a ms; yield after each piece and return as `advance_ticks`."""
        parts = []
        while ticks:
            part = min(TICKS_PER_MS - self._steps // TICK_STEPS % TICKS_PER_MS, ticks)
            parts.append(self._advanced(part))
            ticks -= part
            yield
        return self._record(np.concatenate(parts))

    def _advanced(self, ticks: int) -> FloatArray:
        """Turn the rotors; return their state at the end of each ms, shape (n, axes, STATE_FIELDS)."""
        steps, size = TICK_STEPS * ticks, len(self._rotors.state)
        into = self._steps % REFRESH_STEPS
        rows = (into + steps) // REFRESH_STEPS
        kept = self._backend.numbers([0.0] * (rows * size))
        self._backend.run(
            self._arm, self._joints, self._masses, self._rotors, self._events, kept, self._steps, steps,
            float(self.counts),
        )  # fmt: skip
        self._steps += steps
        return np.array(kept, dtype=np.float64).reshape(rows, self._axes, rk.STATE_FIELDS)

    def _each(self, field: int) -> list[float]:
        return [float(value) for value in self._rotors.state[field :: rk.STATE_FIELDS]]

    def _column(self, field: int) -> FloatArray:
        return np.array(self._rotors.state, dtype=np.float64).reshape(self._axes, rk.STATE_FIELDS)[:, field].copy()

    def _record(self, kept: FloatArray) -> RotorRecord:
        """Return a record of the last `len(kept)` ms; `kept` has shape (n, axes, STATE_FIELDS)."""
        ended = self._steps - self._steps % REFRESH_STEPS
        ago = np.arange(len(kept) - 1, -1, -1) * REFRESH_STEPS
        return RotorRecord(
            counts=self._began_counts + (ended - ago) * rk.DT_COUNTS,
            rotor_rad=(kept[:, :, rk.ANGLE] - self._mounting_rad) / self._teeth,
            coordinate_rad=kept[:, :, rk.PLACE],
            worst_rad=kept[:, :, rk.WORST],
            lost_full_steps=FULL_STEPS_PER_TOOTH * kept[:, :, rk.TURN],
            torque_nm=kept[:, :, rk.TORQUE],
            warmer_k=kept[:, :, rk.HEAT],
        )

    def first_slips(self) -> list[int | None]:
        """Return the instant of each axis' first slip in counts; None if it has not slipped."""
        steps = self._column(rk.SLIP_STEP).tolist()
        return [None if step < 0 else self._began_counts + int(step) * rk.DT_COUNTS for step in steps]

    @property
    def supply_span_v(self) -> tuple[float, float]:
        """The lowest and the highest voltage at the drivers so far."""
        return float(self._rotors.supply[LOWEST_V]), float(self._rotors.supply[HIGHEST_V])

    @property
    def supply_given_j(self) -> tuple[float, float]:
        """Energy that the source has given so far, and its loss in the source's resistance."""
        return float(self._rotors.supply[GIVEN_J]), float(self._rotors.supply[LOST_J])

    def energies(self) -> Energies:
        """Return the energies of each axis."""
        return Energies(*(self._column(field) for field in (rk.IN_J, rk.COPPER_J, rk.DRAG_J, rk.RUBBED_J, rk.LOADED_J)))


def _rest(drive: Drive, rotor_rad: float) -> list[float]:
    """Return the state of a rotor at rest, aligned with its field."""
    state = [0.0] * rk.STATE_FIELDS
    state[rk.ANGLE] = state[rk.FIELD] = drive.motor.teeth * rotor_rad + drive.mounting_rad
    state[rk.PLACE], state[rk.SLIP_STEP] = rotor_rad, -1.0
    return state
