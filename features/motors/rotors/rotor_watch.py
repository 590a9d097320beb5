"""Turn the motors of a machine with its boards: rotors follow the drivers' outputs, switches follow the rotors.

Time advances in stretches of whole servo ticks, after the boards: these have then computed all pulses before the
stretch's end, and no pin can change before it any more. A stretch is too short for any rotor to reach a switch; near a
switch it is one tick. The division of time does not change the result, so a live board turns the rotors in small
pieces in its spare time (`work`), before a stretch must be turned at once.

When the outputs come on for the first time, the rotor's electrical angle is the field's: the rotor is mounted so.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import floor, inf, pi, sqrt
from typing import Final

import numpy as np

from steptwin.controller.motion.kernel import TICK_COUNTS, TICKS_PER_MS
from steptwin.emulator.board.board import Board, Shaft
from steptwin.emulator.board.edges import FloatArray
from steptwin.emulator.drivers.output_follower import FieldTurns, OutputChanges, Steady
from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.emulator.world.switches import WEIGHT_ONE
from steptwin.emulator.world.wires import OutputWire
from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.rotor_backend import RotorBackend
from steptwin.features.motors.rotors.rotor_kernel import (
    AT_COUNTS,
    EVENT_A,
    EVENT_B,
    EVENT_FAST,
    EVENT_FIELD,
    EVENT_FIELDS,
    EVENT_ON,
)
from steptwin.features.motors.rotors.rotors import Drive, RotorRecord, Rotors
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.timer import COUNTS_PER_SECOND

REST_TICKS: Final = 40
"""Longest stretch while no axis moves, 10 ms; no switch can change then."""
PIECEMEAL_TICKS: Final = 20
"""Delay of the rotors in ticks (5 ms) from which on they follow in pieces. Shorter stretches waste time, since much of
the work does not depend on their length.
"""
_LEAST_TICKS: Final = 4
"""Shortest stretch that is begun before its end has come."""
_PIECES: Final = 16
"""Approximate number of pieces of such a stretch."""

_STILL_TICKS: Final = 40
_STILL_RAD_S: Final = 0.01
"""Rotors at standstill: none has been faster for so many ticks, and no driver has changed."""
_FREE_TICKS_MAX: Final = 400

_CYCLE_FULL_STEPS: Final = 4
_TICK_S: Final = TICK_COUNTS / COUNTS_PER_SECOND
_NOTHING: Final = np.empty((0, EVENT_FIELDS))


@dataclass(frozen=True, slots=True, eq=False)
class MotorWiring:
    """Motors at the drivers of all boards, and the arm that they turn.

    Attributes:
        drives: drive of each axis, board by board; a rotor's mounting angle follows when its outputs come on.
        start_rad: angle of each rotor from its axis' zero at power-up.
        arm_with: returns the arm with a mass in kg at the tool's tip.
        payload_kg: mass of the payload.
        supply: power supply of all drivers.
        held_by: output that holds the payload at the tool; None: the tool always carries it.
        backend: computes the rotors; None: the fastest one.
    """

    drives: Sequence[Drive]
    start_rad: Sequence[float]
    arm_with: Callable[[float], Arm]
    payload_kg: float
    supply: PowerSupply
    held_by: OutputWire | None = None
    backend: RotorBackend | None = None


class RotorWatch:
    """The rotors beside the boards of a simulation."""

    def __init__(self, wiring: MotorWiring, boards: Sequence[Board], now: Callable[[], int]) -> None:
        """Prepare the motors at standstill; the boards are off. `now` returns the simulation's time in counts."""
        self._wiring, self._boards, self._now = wiring, boards, now
        self.on_record: Callable[[RotorRecord], None] = lambda _: None
        """Called with the state of all rotors at the end of each ms."""
        self._axes = [(board, axis) for board in boards for axis in range(board.config.axis_count)]
        """Board and number on it of each axis."""
        self._followers = [follower for board in boards for follower in board.follow_outputs()]
        drives = [
            replace(drive, mounting_rad=-drive.motor.teeth * angle)
            for drive, angle in zip(wiring.drives, wiring.start_rad, strict=True)
        ]
        self._teeth = [drive.motor.teeth for drive in drives]
        substeps = [board.config.substeps for board, _ in self._axes]
        self._per_rad = [
            drive.motor.full_steps_per_rev * each / (2.0 * pi) for drive, each in zip(drives, substeps, strict=True)
        ]
        """Substeps in a rad of each rotor."""
        self._cycles_substeps = [_CYCLE_FULL_STEPS * each for each in substeps]
        """Substeps in an electrical cycle of each rotor."""
        self.stretch_ticks: int = REST_TICKS
        """Longest stretch while an axis moves."""
        self.payload_kg: float = wiring.payload_kg
        """Mass of the payload."""
        self.other_payloads_kg: list[float] = []
        """Masses of the payload that have been set since power-up; the last one is the present mass."""
        self._bare, self._loaded = wiring.arm_with(0.0), wiring.arm_with(wiring.payload_kg)
        self._held = int(wiring.held_by is None)
        """1 while the payload hangs at the tool."""
        self.rotors: Rotors = Rotors(drives, self._arm, wiring.supply, wiring.start_rad, backend=wiring.backend)
        self._unmounted = set(range(len(drives)))
        """Axes whose outputs have not been on yet."""
        self._steady: list[Steady | None] = [None] * len(drives)
        self._tables = [_NOTHING] * len(drives)
        """Events of each axis' field angle while only steps change it, as in `_steady`."""
        self._still_ticks = 0
        """Ticks without a change of any driver or a turn of any rotor."""
        self._free_tick = 0
        """Tick before which no rotor can reach a switch."""
        self._slipped = [list(board.slipped_full_steps) for board in boards]
        """Full steps of each rotor's injected slips, by board."""
        self._tick = 0
        """Tick to which the rotors have turned."""
        self._changes: list[tuple[int, Callable[[], None]]] = []
        """Changes of the rotors that do not come from drivers, by time: a tick, and the change at its start."""
        first = 0
        for board in boards:
            board.rotor_of = self._reader(board, first)
            first += board.config.axis_count
        if wiring.held_by is not None:
            boards[wiring.held_by.board].watch_outputs()
        self._pieces: Iterator[None] | None = None
        """Remaining pieces of a stretch that `work` has begun."""
        self._end_tick = 1
        self.next_due_counts: int = TICK_COUNTS - 1
        """Instant just before the end of the stretch; the boards have computed all pulses before it."""

    def _reader(self, board: Board, first: int) -> Callable[[int], Shaft]:
        """Return a function that gives a board the position of an axis' rotor at the start of the present tick."""

        def read(axis: int) -> Shaft:
            self._turn_to_now()
            number = first + axis
            place = (self.rotors.coordinates_rad()[number] - self._wiring.start_rad[number]) * self._per_rad[number]
            lost = self.rotors.lost_full_steps()[number]
            return Shaft(floor(place * UNITS_PER_FULL_STEP / board.config.substeps + 0.5), -int(lost))

        return read

    # --- time

    def step(self, now_counts: int) -> None:
        """Register outputs that have come on, and end the stretch when its time has come."""
        wire = self._wiring.held_by
        if wire is not None:
            level = self._boards[wire.board].output_level(wire.axis, wire.pin)
            if level != self._held:
                self._held = level
                self._carry()
        if any(board.slipped_full_steps != known for board, known in zip(self._boards, self._slipped, strict=True)):
            self._see_slips()
        if now_counts >= self.next_due_counts:
            self._complete()
            while now_counts >= self.next_due_counts:
                self._turn(self._end_tick)
        elif self._still and any(board.moving for board in self._boards):
            self._turn_to_now()
            self._still_ticks = 0
            self._plan()

    def load(self, payload_kg: float) -> None:
        """Set the mass of the payload in kg."""
        self.payload_kg, self._loaded = payload_kg, self._wiring.arm_with(payload_kg)
        self.other_payloads_kg.append(payload_kg)
        self._carry()

    @property
    def _arm(self) -> Arm:
        """Arm that the motors turn now."""
        return self._loaded if self._held else self._bare

    def _carry(self) -> None:
        """Update the masses from the next ms on."""
        tick = -(-self._now() // (TICKS_PER_MS * TICK_COUNTS)) * TICKS_PER_MS
        self._change_at(tick, partial(self.rotors.carry, self._arm))

    def _see_slips(self) -> None:
        """Apply the slips injected by `Slip` at the start of the tick."""
        first = 0
        for number, board in enumerate(self._boards):
            for axis, full_steps in enumerate(board.slipped_full_steps):
                turns = (full_steps - self._slipped[number][axis]) // _CYCLE_FULL_STEPS
                if turns:
                    self._change_at(board.motion.tick, partial(self.rotors.slip, first + axis, turns))
            self._slipped[number] = list(board.slipped_full_steps)
            first += board.config.axis_count

    def _change_at(self, tick: int, change: Callable[[], None]) -> None:
        """Schedule a change of the rotors at the start of a tick; the stretch ends before it."""
        self._changes.append((tick, change))
        self._changes.sort(key=lambda item: item[0])
        self._still_ticks = self._free_tick = 0
        self._plan()

    def finish(self, milliseconds: int) -> None:
        """Turn the rotors alone to an instant in ms since power-up, after the boards' last edge."""
        if TICKS_PER_MS * milliseconds > self._tick:
            self._turn(TICKS_PER_MS * milliseconds)

    @property
    def work_counts(self) -> int:
        """Instant of the next piece of `work`."""
        ticks = self._end_tick - self._tick
        if self._pieces is not None:
            ticks = 0
        elif ticks >= 2 * _LEAST_TICKS:
            ticks = min(ticks // 2, PIECEMEAL_TICKS)
        return (self._tick + ticks) * TICK_COUNTS

    @property
    def pressing(self) -> bool:
        """True if `work` should be done at once, a piece a tick, before the stretch ends."""
        return self._now() >= (self._end_tick - _PIECES) * TICK_COUNTS

    def work(self) -> None:
        """Do one piece of about 50 us that lets the rotors follow; after the last piece the switches follow.

        Every reader of the rotors completes the stretch first.
        """
        if self._pieces is None:
            self._pieces = self._turning(min(self._now_tick, self._end_tick), at_once=False)
        try:
            next(self._pieces)
        except StopIteration:
            self._pieces = None

    def _complete(self) -> None:
        """Do the remaining pieces of a stretch."""
        if self._pieces is not None:
            pieces, self._pieces = self._pieces, None
            deque(pieces, maxlen=0)

    @property
    def _now_tick(self) -> int:
        """Last tick that has begun; all boards have computed their pulses before it."""
        computed = min(board.motion.tick for board in self._boards)
        return min(self._now() // TICK_COUNTS, computed)

    def _turn_to_now(self) -> None:
        self._complete()
        tick = self._now_tick
        while self._tick < tick:
            self._turn(min(tick, self._end_tick))

    def _turn(self, tick: int) -> None:
        """Turn the rotors to the start of a tick, then update the switches."""
        deque(self._turning(tick, at_once=True), maxlen=0)

    def _turning(self, tick: int, *, at_once: bool) -> Iterator[None]:
        """Turn the rotors to the start of a tick, and yield after each piece."""
        until_counts = tick * TICK_COUNTS
        rows = []
        if at_once:
            for board in self._boards:
                board.drain()
        for number, (board, axis) in enumerate(self._axes):
            if not at_once:
                board.drain_axis(axis)
            rows.append(self._rows(number, self._followers[number].look(until_counts)))
            yield
        if any(len(each) for each in rows):
            self.rotors.feed_rows(rows)
            yield
        ticks = tick - self._tick
        if at_once:
            record = self.rotors.advance_ticks(ticks)
        else:
            record = yield from self.rotors.advancing(ticks)
        self._still_ticks += ticks
        self._tick = tick
        changed = False
        while self._changes and self._changes[0][0] <= tick:
            self._changes.pop(0)[1]()
            changed = True
        if record.counts.size:
            self.on_record(record)
        if max(map(abs, self.rotors.rates_rad_s())) > _STILL_RAD_S:
            self._still_ticks = 0
        yield
        if changed or tick >= self._free_tick - (0 if at_once else 2 * PIECEMEAL_TICKS):
            self._place()
            yield
            # After a change, the rotors' greatest acceleration is known a step later.
            self._free_tick = tick if changed else tick + self._free_ticks()
        self._plan()

    def _rows(self, axis: int, changes: FieldTurns | OutputChanges | None) -> FloatArray:
        """Return changes at a driver's outputs as events of the rotors.

        The rotor's angle grows with the position, the field's with DIR low: field angle and phase B change sign.
        """
        if changes is None:
            return _NOTHING
        self._still_ticks = 0
        if isinstance(changes, FieldTurns):
            if self._steady[axis] is not changes.steady:
                self._steady[axis], self._tables[axis] = changes.steady, _table(changes.steady)
            rows = self._tables[axis][changes.steady.states(changes.substeps)]
        else:
            rows = _filled(changes.counts.size, changes.currents_a, changes.fast)
        rows[:, AT_COUNTS] = changes.counts
        np.multiply(changes.substeps, -2.0 * pi / self._cycles_substeps[axis], out=rows[:, EVENT_FIELD])
        if axis in self._unmounted and rows[:, EVENT_ON].any():
            field_rad = float(rows[np.argmax(rows[:, EVENT_ON]), EVENT_FIELD])
            self.rotors.mount(axis, field_rad - self._teeth[axis] * self._wiring.start_rad[axis])
            self._unmounted.remove(axis)
        return rows

    # --- switches

    def positions_full_steps(self) -> list[float]:
        """Return where each rotor is since power-up, at the start of the present tick."""
        self._turn_to_now()
        at = zip(self.rotors.coordinates_rad(), self._wiring.start_rad, self._wiring.drives, strict=True)
        return [(place - start) * (drive.motor.full_steps_per_rev / (2.0 * pi)) for place, start, drive in at]

    def _place(self) -> None:
        """Update the switches from the rotors."""
        places = self.rotors.coordinates_rad()
        at = [floor(place * per_rad + 0.5) for place, per_rad in zip(places, self._per_rad, strict=True)]
        first = 0
        for board in self._boards:
            count = board.config.axis_count
            board.place(at[first : first + count])
            first += count

    def _plan(self) -> None:
        """Choose the end of the next stretch."""
        moving = any(board.moving for board in self._boards)
        if self._still and not moving:
            end = self._tick + REST_TICKS
        else:
            end = min(self._tick + (self.stretch_ticks if moving else REST_TICKS), self._free_tick)
        if self._changes:
            end = min(end, self._changes[0][0])
        self._end_tick = max(end, self._tick + 1)
        self.next_due_counts = self._end_tick * TICK_COUNTS - 1

    @property
    def _still(self) -> bool:
        """True while all rotors stay at standstill until a driver changes; then none approaches a switch."""
        return self._still_ticks >= _STILL_TICKS

    def _free_ticks(self) -> int:
        """Return the number of ticks before any rotor can reach a switch, by its speed and its greatest acceleration.

        End stops count as switches, since their impact accelerates all other axes.
        """
        speeds = [abs(rate) * per for rate, per in zip(self.rotors.rates_rad_s(), self._per_rad, strict=True)]
        accelerations = [
            most * per for most, per in zip(self.rotors.accelerations_max_rad_s2(), self._per_rad, strict=True)
        ]
        if inf in accelerations:  # nothing has turned yet
            return 0
        least, first = float(_FREE_TICKS_MAX), 0
        for axis, way in self._distances_to_stops():
            least = min(least, _ticks_to(way, speeds[axis], accelerations[axis]))
        for board in self._boards:
            for travel, distance in board.distances_to_change():
                speed = acceleration = 0.0
                for axis, weight in travel.weights:
                    share = abs(weight) / WEIGHT_ONE
                    speed += share * speeds[first + axis]
                    acceleration += share * accelerations[first + axis]
                way = max(0.0, distance - 1.0)  # positions are rounded
                least = min(least, _ticks_to(way, speed, acceleration))
            first += board.config.axis_count
        return int(least)

    def _distances_to_stops(self) -> list[tuple[int, float]]:
        """Return the axes with end stops, and the distance of each to the nearer stop in substeps."""
        places = self.rotors.coordinates_rad()
        return [
            (axis, max(0.0, min(places[axis] - drive.lower_rad, drive.upper_rad - places[axis])) * self._per_rad[axis])
            for axis, drive in enumerate(self._wiring.drives)
            if drive.lower_rad != -inf or drive.upper_rad != inf
        ]


def _ticks_to(way: float, speed: float, acceleration: float) -> float:
    """Return the least number of ticks for a distance in substeps."""
    return (sqrt(speed * speed + 2.0 * acceleration * way) - speed) / (acceleration * _TICK_S)


def _table(steady: Steady) -> FloatArray:
    """Return the events of a turning field by its angle; the caller fills in instant and angle."""
    count = len(steady.currents_a)
    return _filled(count, steady.currents_a, np.full(count, steady.fast))


def _filled(count: int, currents_a: FloatArray, fast: FloatArray) -> FloatArray:
    rows = np.zeros((count, EVENT_FIELDS))
    rows[:, EVENT_A] = currents_a[:, 0]
    np.negative(currents_a[:, 1], out=rows[:, EVENT_B])
    rows[:, EVENT_FAST] = fast
    rows[:, EVENT_ON] = currents_a.any(axis=1)
    return rows
