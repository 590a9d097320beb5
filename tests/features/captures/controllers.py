"""Made controllers for tests: straight moves, the steps that a rule makes of them, and a logic analyser's view.

It shares no code with the product: positions are closed formulas on a fine grid, and thresholds are interpolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.host.planning.motion import JointLaw, Motion

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]

GRID_S = 2e-5
EXACT = 1e-9


class Move(NamedTuple):
    """A straight move by a trapezoid of speed: begin, duration, start, direction, distance, speed, acceleration."""

    begin_s: float
    lasts_s: float
    start: Floats
    direction: Floats
    distance: float
    speed: float
    acceleration: float

    def way(self, t_s: Floats) -> Floats:
        """Return the way made at instants since the begin."""
        t, ramp_s = np.clip(t_s, 0.0, self.lasts_s), self.speed / self.acceleration
        up = self.acceleration * t * t / 2.0
        down = self.distance - self.acceleration * (self.lasts_s - t) ** 2 / 2.0
        return np.where(t < ramp_s, up, np.where(t > self.lasts_s - ramp_s, down, self.speed * (t - ramp_s / 2.0)))

    def rate(self, t_s: Floats) -> Floats:
        """Return the speed at instants since the begin."""
        t = np.clip(t_s, 0.0, self.lasts_s)
        return np.minimum(np.minimum(t, self.lasts_s - t) * self.acceleration, self.speed)


@dataclass
class Moves(JointLaw):
    """Straight moves with rests between some."""

    joint_names: tuple[str, ...]
    moves: list[Move] = field(default_factory=list)

    @classmethod
    def random(
        cls,
        random: np.random.Generator,
        names: Sequence[str],
        count: int,
        start: Floats,
        speed: float,
        rough: float,
        reach: float = 60.0,
    ) -> "Moves":
        """Return some moves of up to `reach` units in all directions, some of them without one of the joints."""
        made, at_s, place = cls(tuple(names)), 0.0, start.astype(np.float64)
        for _ in range(count):
            way = random.uniform(-reach, reach, place.size)
            if random.random() < 0.3 and place.size > 1:
                way[random.integers(place.size)] = 0.0
            distance = float(np.linalg.norm(way))
            top, acceleration = random.uniform(0.3, 1.0) * speed, random.uniform(0.3, 1.0) * rough
            top = min(top, float(np.sqrt(distance * acceleration)))
            lasts_s = distance / top + top / acceleration
            made.moves.append(Move(at_s, lasts_s, place, way / distance, distance, top, acceleration))
            place = place + way
            at_s += lasts_s + (random.uniform(0.05, 0.2) if random.random() < 0.3 else 0.0)
        return made

    def at_other_rates(self, part: float) -> "Moves":
        """Return the same way at a part of the acceleration, each move with the top speed that it then can have."""
        made, at_s = Moves(self.joint_names), 0.0
        for move in self.moves:
            acceleration = part * move.acceleration
            speed = min(move.speed, float(np.sqrt(move.distance * acceleration)))
            lasts_s = move.distance / speed + speed / acceleration
            made.moves.append(move._replace(begin_s=at_s, lasts_s=lasts_s, speed=speed, acceleration=acceleration))
            at_s += lasts_s
        return made

    @property
    def duration_s(self) -> float:
        return self.moves[-1].begin_s + self.moves[-1].lasts_s

    @property
    def motion(self) -> Motion:
        """The motion of these joints, for the judge."""
        return Motion(self.joint_names, self.duration_s, self, tuple(move.begin_s for move in self.moves[1:]))

    def positions(self, t_s: Floats) -> Floats:
        return self._at(t_s, lambda move, t: move.start + np.outer(move.way(t), move.direction))

    def velocities(self, t_s: Floats) -> Floats:
        return self._at(t_s, lambda move, t: np.outer(move.rate(t), move.direction))

    def _at(self, t_s: Floats, value: "object") -> Floats:
        found = np.zeros((t_s.size, len(self.joint_names)))
        number = np.maximum(np.searchsorted([move.begin_s for move in self.moves], t_s, "right") - 1, 0)
        for index, move in enumerate(self.moves):
            own = number == index
            if own.any():
                found[own] = value(move, t_s[own] - move.begin_s)  # type: ignore[operator]
        return found


class Steps(NamedTuple):
    """Steps of one axis: instants and signs."""

    time_s: Floats
    signs: Signs


def by_thresholds(t_s: Floats, p: Floats, up: float, down: float, count: int) -> Steps:
    """Return the steps of a counter n that goes up at p = n + up and down at p = n - down."""
    times, signs = [np.empty(0)], [np.empty(0, np.int8)]
    ways = np.sign(np.diff(p))
    moving = np.flatnonzero(ways)
    turns = moving[np.flatnonzero(np.diff(ways[moving])) + 1]
    bounds = np.concatenate(([0], turns, [p.size - 1]))
    for first, last in pairwise(bounds.tolist()):
        sign, beyond = (1, up) if p[last] > p[first] else (-1, down)
        made = max(int(np.floor(sign * (p[last] - count) - beyond + EXACT)) + 1, 0)
        thresholds = count + sign * (beyond + np.arange(made))
        part = slice(first, last + 1)
        times.append(np.interp(sign * thresholds, sign * p[part], t_s[part]))
        signs.append(np.full(made, sign, np.int8))
        count += sign * made
    return Steps(np.concatenate(times), np.concatenate(signs))


def by_counts(t_s: Floats, counts: NDArray[np.int64]) -> Steps:
    """Return the steps of a counter that is looked at at instants; it changes by one at most."""
    moves = np.diff(counts)
    at = np.flatnonzero(moves)
    assert np.abs(moves).max(initial=0) <= 1
    return Steps(t_s[at + 1], moves[at].astype(np.int8))


def whole(p: Floats) -> NDArray[np.int64]:
    """Return (int)p, with what rounding leaves at whole numbers."""
    return np.trunc(p + np.sign(p) * EXACT).astype(np.int64)


def by_segments(moves: Moves, per_unit: Floats) -> list[Steps]:
    """Return the steps of 10 ms segments between rounded targets, at one rate each, the minor axes by Bresenham."""
    ends_s = np.arange(0.0, moves.duration_s + 0.01, 0.01)
    targets = np.rint(moves.positions(ends_s) * per_unit).astype(np.int64)
    times: list[list[Floats]] = [[np.empty(0)] for _ in per_unit]
    signs: list[list[Signs]] = [[np.empty(0, np.int8)] for _ in per_unit]
    for begin_s, way in zip(ends_s[:-1], np.diff(targets, axis=0), strict=True):
        events = int(np.abs(way).max())
        for axis, own in enumerate(way.tolist()):
            sums = (np.arange(events + 1) * abs(own) + events // 2) // max(events, 1)
            at = np.flatnonzero(np.diff(sums))
            times[axis].append(begin_s + 0.01 * (at + 0.5) / max(events, 1))
            signs[axis].append(np.full(at.size, np.sign(own), np.int8))
    return [Steps(np.concatenate(t), np.concatenate(s)) for t, s in zip(times, signs, strict=True)]


RULES = ("hysteresis", "round", "floor", "int", "accumulator", "timer", "int on a timer", "segments")


def made_steps(moves: Moves, per_unit: Floats, rule: str, random: np.random.Generator) -> list[Steps]:
    """Return the steps of each axis by a rule."""
    if rule == "segments":
        return by_segments(moves, per_unit)
    period_s = float(random.choice([1e-5, 2e-5, 4e-5])) if "timer" in rule else GRID_S
    t_s = np.arange(0.0, moves.duration_s + period_s, period_s)
    made = []
    for p in (moves.positions(t_s) * per_unit).T:
        near = int(np.floor(p[0] + 0.5))
        if rule == "timer":
            made.append(by_counts(t_s - period_s / 2.0, np.floor(p + 0.5).astype(np.int64)))
        elif rule == "int on a timer":
            made.append(by_counts(t_s - period_s / 2.0, whole(p)))
        elif rule == "int":
            counts = whole(p)
            at = np.flatnonzero(np.diff(counts))
            outer = np.where(
                p[at] + p[at + 1] > 0.0, np.maximum(counts[at], counts[at + 1]), np.minimum(counts[at], counts[at + 1])
            )
            part = np.clip((outer - p[at]) / (p[at + 1] - p[at]), 0.0, 1.0)
            made.append(Steps(t_s[at] + part * period_s, np.sign(np.diff(counts)[at]).astype(np.int8)))
        else:
            up, down, count = {
                "hysteresis": (9 / 16, 9 / 16, near),
                "round": (0.5, 0.5, near),
                "floor": (1.0, 0.0, int(np.floor(p[0] + EXACT))),
                "accumulator": (1.0, 1.0, near),
            }[rule]
            made.append(by_thresholds(t_s, p, up, down, count))
    return made


class Clock(NamedTuple):
    """How an analyser sees instants: when its record began, its clock, the grid of its samples, the jitter before."""

    offset_s: float
    ppm: float
    rate_hz: float
    jitter_s: float = 0.0

    def sees(self, steps: Steps, random: np.random.Generator) -> Steps:
        """Return steps as they are recorded."""
        late_s = random.uniform(-self.jitter_s, self.jitter_s, steps.time_s.size)
        order = np.argsort(steps.time_s + late_s, kind="stable")
        time_s = self.offset_s + (steps.time_s + late_s)[order] * (1.0 + self.ppm * 1e-6)
        return Steps((np.ceil(time_s * self.rate_hz) - 0.5) / self.rate_hz, steps.signs[order])


def wires(steps: Steps, width_s: float = 1e-6) -> tuple[Floats, Floats]:
    """Return the edges of STEP and of DIR, which begins low and changes in the middle between two steps."""
    edges = np.column_stack([steps.time_s, steps.time_s + width_s]).ravel()
    turns = np.flatnonzero(np.diff(steps.signs, prepend=np.int8(-1)))
    before_s = np.where(turns > 0, steps.time_s[np.maximum(turns - 1, 0)], steps.time_s[turns] - 1e-3)
    return edges, (before_s + steps.time_s[turns]) / 2.0
