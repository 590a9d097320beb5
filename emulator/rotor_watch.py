"""Let the motors of a machine turn with its boards: the rotors follow the drivers' outputs, the switches the rotors.

The rotors stand at the start of a servo tick and go on in stretches of whole ticks. The boards have then computed all
pulses before the stretch's end, and no pin can change before it any more. A stretch is so short that no rotor can reach
a switch unseen; near a switch it is a tick. How time is divided changes no result.

Rotor and field have a common electrical angle when the outputs come on for the first time: the rotor is mounted so.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import floor, inf, pi, sqrt
from typing import Final

import numpy as np

from steptwin.controller.kernel import TICK_COUNTS, TICKS_PER_MS
from steptwin.controller.measurements import Shaft
from steptwin.emulator.arm import Arm
from steptwin.emulator.board import Board
from steptwin.emulator.edges import FloatArray
from steptwin.emulator.power_supply import PowerSupply
from steptwin.emulator.rotor_backend import RotorBackend
from steptwin.emulator.rotor_kernel import EVENT_FIELDS
from steptwin.emulator.rotors import Drive, RotorRecord, Rotors
from steptwin.emulator.shelf_watch import OutputWire
from steptwin.emulator.switches import WEIGHT_ONE
from steptwin.emulator.tb6560 import CYCLE_SIXTEENTHS, FULL_STEP_SIXTEENTHS, OutputChanges
from steptwin.protocol.objects import UNITS_PER_FULL_STEP
from steptwin.protocol.timer import COUNTS_PER_SECOND

REST_TICKS: Final = 40
"""Greatest stretch while no axis moves, 10 ms: nothing waits for the rotors then."""

_RAD_PER_SIXTEENTH: Final = 2.0 * pi / CYCLE_SIXTEENTHS
_TICK_S: Final = TICK_COUNTS / COUNTS_PER_SECOND
_NOTHING: Final = np.empty((0, EVENT_FIELDS))


@dataclass(frozen=True, slots=True, eq=False)
class MotorWiring:
    """The motors at the drivers of all boards, and what they turn.

    Attributes:
        drives: of each axis, board by board; how a rotor is mounted is found when its outputs come on.
        start_rad: angle of each rotor from its axis' zero at power-up.
        arm: what they turn.
        loaded: the same with the payload.
        supply: of all drivers.
        held_by: output while which is on the payload hangs at the tool; None: always.
        stretch_ticks: greatest stretch while an axis moves.
        backend: how the rotors are computed; None: as fast as can be.
    """

    drives: Sequence[Drive]
    start_rad: Sequence[float]
    arm: Arm
    loaded: Arm
    supply: PowerSupply
    held_by: OutputWire | None = None
    stretch_ticks: int = REST_TICKS
    backend: RotorBackend | None = None


class RotorWatch:
    """The rotors beside the boards of a simulation."""

    def __init__(self, wiring: MotorWiring, boards: Sequence[Board], now: Callable[[], int]) -> None:
        """Let the motors stand; the boards are not switched on yet. `now` tells the simulation's time in counts."""
        self._wiring, self._boards, self._now = wiring, boards, now
        self.on_record: Callable[[RotorRecord], None] = lambda _: None
        """Called with the state of all rotors at the end of each ms."""
        self._followers = [follower for board in boards for follower in board.follow_outputs()]
        drives = [
            replace(drive, mounting_rad=-drive.motor.teeth * angle)
            for drive, angle in zip(wiring.drives, wiring.start_rad, strict=True)
        ]
        self._teeth = [drive.motor.teeth for drive in drives]
        self._per_rad = [drive.motor.full_steps_per_rev * FULL_STEP_SIXTEENTHS / (2.0 * pi) for drive in drives]
        """Sixteenths of a full step in a rad of each rotor."""
        arm = wiring.loaded if wiring.held_by is None else wiring.arm
        self.rotors = Rotors(drives, arm, wiring.supply, wiring.start_rad, backend=wiring.backend)
        self._unmounted = set(range(len(drives)))
        """Axes whose outputs have not been on yet."""
        self._slipped = [0] * len(drives)
        """Sixteenths by which each rotor has been made to slip."""
        self._tick = 0
        """Tick up to whose start the rotors have turned."""
        self._held = 0
        self._carry_tick: int | None = None
        """Start of a ms at which the payload is taken or left; None while nothing of the kind is to come."""
        first = 0
        for board in boards:
            board.rotor_of = self._reader(first)
            first += board.config.axis_count
        if wiring.held_by is not None:
            boards[wiring.held_by.board].watch_outputs()
        self._end_tick = self._stretch_end()
        self.next_counts = self._end_tick * TICK_COUNTS - 1
        """Instant just before the end of the stretch: the boards have computed what comes before, and no more."""

    def _reader(self, first: int) -> Callable[[int], Shaft]:
        """Return what tells a board where the rotor of one of its axes is, at the start of the present tick."""

        def read(axis: int) -> Shaft:
            self._turn_to_now()
            number = first + axis
            place = (self.rotors.coordinates_rad()[number] - self._wiring.start_rad[number]) * self._per_rad[number]
            lost = self.rotors.lost_full_steps()[number]
            return Shaft(floor(place * UNITS_PER_FULL_STEP / FULL_STEP_SIXTEENTHS + 0.5), -int(lost))

        return read

    # --- time

    def look(self) -> None:
        """See what has happened by now: outputs that have switched, and whether a stretch has ended."""
        wire = self._wiring.held_by
        if wire is not None:
            level = self._boards[wire.board].output_level(wire.axis, wire.pin)
            if level != self._held:
                self._held = level
                self._carry_tick = -(-self._now() // (TICKS_PER_MS * TICK_COUNTS)) * TICKS_PER_MS
                self._plan()
        if self._now() >= self.next_counts:
            self._turn(self._end_tick)

    def finish(self, milliseconds: int) -> None:
        """Turn the rotors alone up to an instant since power-up, after the boards' last edge."""
        if TICKS_PER_MS * milliseconds > self._tick:
            self._turn(TICKS_PER_MS * milliseconds)

    def _turn_to_now(self) -> None:
        computed = min(board.firmware.motion.tick for board in self._boards)
        tick = min(self._now() // TICK_COUNTS, computed)
        while self._tick < tick:
            self._turn(min(tick, self._end_tick))

    def _turn(self, tick: int) -> None:
        """Turn the rotors up to the start of a tick, and let the switches follow."""
        for board in self._boards:
            board.drain()
        until_counts = tick * TICK_COUNTS
        rows = [self._rows(axis, follower.look(until_counts)) for axis, follower in enumerate(self._followers)]
        self._let_slip()
        if any(len(each) for each in rows):
            self.rotors.feed_rows(rows)
        record = self.rotors.advance_ticks(tick - self._tick)
        self._tick = tick
        if self._carry_tick == tick:
            self.rotors.carry(self._wiring.loaded if self._held else self._wiring.arm)
            self._carry_tick = None
        if record.counts.size:
            self.on_record(record)
        self._place()
        self._plan()

    def _rows(self, axis: int, changes: OutputChanges | None) -> FloatArray:
        """Return changes at a driver's outputs as the rotors take them.

        The rotor's angle grows with the position, the field's with DIR low: so it is taken the other way round, and
        phase B with it.
        """
        if changes is None:
            return _NOTHING
        rows = np.empty((changes.counts.size, EVENT_FIELDS))
        rows[:, 0] = changes.counts
        np.multiply(changes.sixteenths, -_RAD_PER_SIXTEENTH, out=rows[:, 1])
        rows[:, 2] = changes.currents_a[:, 0]
        np.negative(changes.currents_a[:, 1], out=rows[:, 3])
        rows[:, 4] = changes.fast
        rows[:, 5] = changes.currents_a.any(axis=1)
        if axis in self._unmounted and rows[:, 5].any():
            field_rad = float(rows[np.argmax(rows[:, 5]), 1])
            self.rotors.mount(axis, field_rad - self._teeth[axis] * self._wiring.start_rad[axis])
            self._unmounted.remove(axis)
        return rows

    def _let_slip(self) -> None:
        slipped = [sixteenths for board in self._boards for sixteenths in board.slipped_sixteenths()]
        if slipped == self._slipped:
            return
        for axis, (now, before) in enumerate(zip(slipped, self._slipped, strict=True)):
            if now != before:
                self.rotors.slip(axis, (now - before) // CYCLE_SIXTEENTHS)
        self._slipped = slipped

    # --- switches

    def positions_sixteenths(self) -> list[float]:
        """Return where each rotor is since power-up, at the start of the present tick, in sixteenths of a full step."""
        self._turn_to_now()
        at = zip(self.rotors.coordinates_rad(), self._wiring.start_rad, self._per_rad, strict=True)
        return [(place - start) * per_rad for place, start, per_rad in at]

    def _place(self) -> None:
        places = self.rotors.coordinates_rad()
        at = [floor(place * per_rad + 0.5) for place, per_rad in zip(places, self._per_rad, strict=True)]
        first = 0
        for board in self._boards:
            count = board.config.axis_count
            board.place(at[first : first + count])
            first += count

    def _plan(self) -> None:
        """Choose the end of the next stretch."""
        self._end_tick = self._stretch_end()
        self.next_counts = self._end_tick * TICK_COUNTS - 1

    def _stretch_end(self) -> int:
        moving = any(board.moving for board in self._boards)
        ticks = min(self._wiring.stretch_ticks if moving else REST_TICKS, self._ticks_to_switch())
        end = self._tick + max(1, ticks)
        return end if self._carry_tick is None else min(end, max(self._carry_tick, self._tick + 1))

    def _ticks_to_switch(self) -> int:
        """Return the number of ticks in which no rotor reaches a switch, by its speed and its greatest acceleration."""
        speeds = [abs(rate) * per for rate, per in zip(self.rotors.rates_rad_s(), self._per_rad, strict=True)]
        accelerations = [
            most * per for most, per in zip(self.rotors.accelerations_max_rad_s2(), self._per_rad, strict=True)
        ]
        least, first = float(REST_TICKS), 0
        for board in self._boards:
            for travel, distance in board.ways_to_change():
                speed = acceleration = 0.0
                for axis, weight in travel.weights:
                    share = abs(weight) / WEIGHT_ONE
                    speed += share * speeds[first + axis]
                    acceleration += share * accelerations[first + axis]
                if acceleration == inf:  # nothing has turned yet
                    return 1
                way = max(0.0, distance - 1.0)  # positions are rounded
                least = min(least, (sqrt(speed * speed + 2.0 * acceleration * way) - speed) / (acceleration * _TICK_S))
            first += board.config.axis_count
        return int(least)
