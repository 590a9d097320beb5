"""Made captures for tests: a drawn path, the steps that a controller's rule makes along it by a law of its own, faults.

It shares no code with the product: a path is a list of strokes from standstill to standstill, each a line of many
points; positions are sampled finely, thresholds are interpolated, and blocks go by Bresenham's counters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from steptwin.features.captures.channel_map import AxisSignals, ProbeLine
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.robots.poses.task import TASKS
from steptwin.host.verify import Expectation
from tests.features.captures.controllers import Floats, Signs, Steps, by_counts, by_thresholds, wires

NAMES = "xyz"


class Law(NamedTuple):
    """A speed law: mm/s and mm/s2."""

    speed: float
    acceleration: float


@dataclass
class Drawn(JointLaw):
    """A path of strokes in mm, drawn by a trapezoid of speed each."""

    strokes: list[Floats]
    law: Law
    pause_s: float = 0.0

    def __post_init__(self) -> None:
        self.ways = [
            np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(s, axis=0), axis=1)))) for s in self.strokes
        ]
        lengths = [way[-1] for way in self.ways]
        speed, acceleration = self.law
        self.tops = [min(speed, float(np.sqrt(length * acceleration))) for length in lengths]
        self.lasts_s = [length / top + top / acceleration for length, top in zip(lengths, self.tops, strict=True)]
        self.begins_s = np.concatenate(([0.0], np.cumsum(np.array(self.lasts_s) + self.pause_s)))

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(NAMES[: self.strokes[0].shape[1]])

    @property
    def duration_s(self) -> float:
        return float(np.ceil(1000.0 * self.begins_s[-1]) / 1000.0)

    def gone(self, stroke: int, t_s: Floats) -> Floats:
        """Return how far a stroke is drawn, at instants since its begin."""
        lasts_s, top, acceleration = self.lasts_s[stroke], self.tops[stroke], self.law.acceleration
        t, ramp_s, length = np.clip(t_s, 0.0, lasts_s), top / acceleration, self.ways[stroke][-1]
        up, down = acceleration * t * t / 2.0, length - acceleration * (lasts_s - t) ** 2 / 2.0
        return np.where(t < ramp_s, up, np.where(t > lasts_s - ramp_s, down, top * (t - ramp_s / 2.0)))

    def positions(self, t_s: Floats) -> Floats:
        number = np.clip(np.searchsorted(self.begins_s, t_s, "right") - 1, 0, len(self.strokes) - 1)
        found = np.empty((t_s.size, self.strokes[0].shape[1]))
        for stroke in np.unique(number).tolist():
            own = number == stroke
            gone = self.gone(stroke, t_s[own] - self.begins_s[stroke])
            found[own] = np.column_stack(
                [np.interp(gone, self.ways[stroke], column) for column in self.strokes[stroke].T]
            )
        return found

    def velocities(self, t_s: Floats) -> Floats:
        return (self.positions(t_s + 1e-6) - self.positions(t_s - 1e-6)) / 2e-6

    def expected(self, per_mm: float) -> Expectation:
        """Return the expectation of a machine whose joints are its tool's coordinates."""
        axes = self.strokes[0].shape[1]

        def forward(joints: Floats) -> Floats:
            return np.column_stack([joints, np.zeros((len(joints), 3 - axes))])

        return Expectation(
            Motion(self.joint_names, self.duration_s, self),
            np.full(axes, per_mm),
            ("mm",) * axes,
            forward,
            task=TASKS["position"],
        )


# --- paths


def polygon(corners: Sequence[Sequence[float]]) -> list[Floats]:
    """Return a stroke from each corner to the next."""
    places = np.array(corners, float)
    return [places[i : i + 2] for i in range(len(places) - 1)]


def arc(centre: Sequence[float], radius: float, begin_deg: float, sweep_deg: float) -> Floats:
    """Return a stroke along an arc."""
    turn = np.deg2rad(begin_deg + np.linspace(0.0, sweep_deg, 721))
    return np.column_stack([centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn)])


def random_path(random: np.random.Generator, size: float = 8.0) -> list[Floats]:
    """Return one of several kinds of paths."""
    turns = np.deg2rad(np.arange(6) * 144.0)
    paths = (
        polygon([(0, 0), (size, 0), (size, 0.7 * size), (0, 0.7 * size), (0, 0)]),
        polygon([(0.0,), (size,), (0.3 * size,), (0.9 * size,), (-0.5 * size,)]),
        polygon((size * np.column_stack([np.sin(turns), np.cos(turns)])).tolist()),
        [arc((0.0, 0.0), size / 2.0, 0.0, 360.0), arc((0.0, 0.0), size / 2.0, 0.0, -250.0)],
        polygon([(i * size / 12.0, (i % 2) * size / 3.0) for i in range(13)]),
        polygon([(0, 0), *random.uniform(-size, size, (6, 2)).round(3).tolist()]),
        polygon([(0, 0, 0), (0, 0, -2.0), (size, 0, -2.0), (size, size, -2.0), (0.2, 0.4, -1.0), (0, 0, 0)]),
    )
    return paths[int(random.integers(len(paths)))]


# --- controllers


def nearest(drawn: Drawn, per_mm: float, random: np.random.Generator, early_s: float = 0.0) -> list[Steps]:
    """Return the steps of a nearest-step rule; each may come early, but by half of its interval at most: Klipper's."""
    t_s = np.arange(0.0, drawn.duration_s + 2e-5, 2e-5)
    made = []
    for p in (drawn.positions(t_s) * per_mm).T:
        steps = _without_touches(by_thresholds(t_s, p, 0.5, 0.5, round(float(p[0]))))
        gaps_s = np.diff(steps.time_s, prepend=-1.0)
        made.append(
            Steps(steps.time_s - random.uniform(0.0, 1.0, gaps_s.size) * np.minimum(early_s, gaps_s / 2), steps.signs)
        )
    return made


def _without_touches(steps: Steps) -> Steps:
    """Return steps without those that are taken back within 0.75 ms, where an axis turns at a threshold."""
    back = np.flatnonzero((np.diff(steps.time_s) < 7.5e-4) & (np.diff(steps.signs) != 0))
    gone = np.union1d(back, back + 1)
    return Steps(np.delete(steps.time_s, gone), np.delete(steps.signs, gone))


def klipper(drawn: Drawn, per_mm: float, random: np.random.Generator) -> list[Steps]:
    return nearest(drawn, per_mm, random, 25e-6)


def exact(drawn: Drawn, per_mm: float, random: np.random.Generator) -> list[Steps]:
    return nearest(drawn, per_mm, random)


def thresholds(up: float, down: float, first: Callable[[float], float]) -> "Controller":
    def made(drawn: Drawn, per_mm: float, _: np.random.Generator) -> list[Steps]:
        t_s = np.arange(0.0, drawn.duration_s + 2e-5, 2e-5)
        columns = (drawn.positions(t_s) * per_mm).T
        return [_without_touches(by_thresholds(t_s, p, up, down, int(first(float(p[0]) + 1e-9)))) for p in columns]

    return made


def linuxcnc(drawn: Drawn, per_mm: float, random: np.random.Generator) -> list[Steps]:
    """Return the steps of positions that are linear within 1 ms, on the grid of a base period."""
    period_s = 25e-6 if drawn.law.speed * per_mm > 15e3 else float(random.choice([25e-6, 50e-6]))
    servo_s = np.arange(0.0, drawn.duration_s + 2e-3, 1e-3)
    t_s = np.arange(0.0, servo_s[-1], period_s)
    columns = [np.interp(t_s, servo_s, p) for p in (drawn.positions(servo_s) * per_mm).T]
    return [by_counts(t_s, np.floor(p + 0.5).astype(np.int64)) for p in columns]


def blocks(drawn: Drawn, per_mm: float, _: np.random.Generator, burst: int = 1) -> list[Steps]:
    """Return the steps of blocks between rounded targets: grbl's segments of 10 ms, or Marlin's bursts."""
    axes = drawn.strokes[0].shape[1]
    times: list[list[Floats]] = [[np.empty(0)] for _ in range(axes)]
    signs: list[list[Signs]] = [[np.empty(0, np.int8)] for _ in range(axes)]
    at = np.rint(drawn.strokes[0][0] * per_mm).astype(np.int64)
    for number, stroke in enumerate(drawn.strokes):
        way = drawn.ways[number]
        chords = np.unique(
            np.linspace(0, len(stroke) - 1, _chords(stroke, 0.002 if burst == 1 else 1e-4) + 1).round().astype(int)
        )
        t_s = np.append(np.arange(0.0, drawn.lasts_s[number], 0.01 if burst == 1 else 1e-3), drawn.lasts_s[number])
        gone = drawn.gone(number, t_s)
        rising = np.concatenate(([True], np.diff(gone) > 0.0))
        for begin, end in pairwise(chords.tolist()):
            target = np.rint(stroke[end] * per_mm).astype(np.int64)
            move, at = target - at, target
            events = int(np.abs(move).max())
            if not events:
                continue
            share = (np.arange(1, events + 1) - 0.5) / events
            at_s = np.interp(way[begin] + share * (way[end] - way[begin]), gone[rising], t_s[rising])
            if burst > 1:
                place = np.arange(events) % burst
                at_s = at_s[np.arange(events) - place] + place * 5e-6
            for axis, own in enumerate(move.tolist()):
                sums = (np.arange(events + 1) * abs(own) + events // 2) // events
                made = np.flatnonzero(np.diff(sums))
                times[axis].append(drawn.begins_s[number] + at_s[made])
                signs[axis].append(np.full(made.size, np.sign(own), np.int8))
    return [Steps(np.concatenate(t), np.concatenate(s)) for t, s in zip(times, signs, strict=True)]


def _chords(stroke: Floats, off_mm: float) -> int:
    """Return the number of chords of an arc within a distance; 1 for a line."""
    if len(stroke) == 2:
        return 1
    radius = float(np.linalg.norm(stroke[0] - stroke[len(stroke) // 2])) / 2.0
    length = float(np.linalg.norm(np.diff(stroke, axis=0), axis=1).sum())
    return max(int(length / (2.0 * np.sqrt(off_mm * (2.0 * radius - off_mm)))), 3)


def marlin(drawn: Drawn, per_mm: float, random: np.random.Generator) -> list[Steps]:
    return blocks(drawn, per_mm, random, int(random.choice([2, 4])))


Controller = Callable[[Drawn, float, np.random.Generator], list[Steps]]
CONTROLLERS_MADE: dict[str, Controller] = {
    "nearest step": exact,
    "klipper": klipper,
    "grbl": blocks,
    "marlin": marlin,
    "linuxcnc": linuxcnc,
    "step below": thresholds(1.0, 1e-6, np.floor),
    "whole steps": thresholds(1.0, 1.0, round),
}


# --- faults


def lose(steps: Steps, first: int, count: int) -> Steps:
    """Return steps without some in a row."""
    gone = slice(first, first + count)
    return Steps(np.delete(steps.time_s, gone), np.delete(steps.signs, gone))


def add(steps: Steps, after: int, count: int = 1) -> Steps:
    """Return steps with some more between two, in the direction of the first."""
    begin_s, end_s = steps.time_s[after : after + 2]
    more = begin_s + (end_s - begin_s) * np.arange(1, count + 1) / (count + 1)
    where = np.full(count, after + 1)
    return Steps(np.insert(steps.time_s, where, more), np.insert(steps.signs, where, steps.signs[after]))


def change(steps: Sequence[Steps], axis: int, made: Steps) -> list[Steps]:
    """Return the steps of all axes with those of one exchanged."""
    return [made if i == axis else own for i, own in enumerate(steps)]


# --- a logic analyser


def signals(
    steps: Sequence[Steps], rate_hz: float = 8e6, ppm: float = 0.0, jitter_s: float = 0.0, seed: int = 0
) -> list[AxisSignals]:
    """Return the signals of the axes as an analyser of a rate, with a clock of its own, records them."""
    random = np.random.default_rng(seed)
    made = []
    for name, own in zip(NAMES, steps, strict=False):
        late_s = random.uniform(-jitter_s, jitter_s, own.time_s.size)
        order = np.argsort(own.time_s + late_s, kind="stable")
        edges, turns = wires(Steps((own.time_s + late_s)[order] + 0.01, own.signs[order]))
        lines = [
            ProbeLine(f"{name}_{part}", 0, (np.ceil(at_s * (1.0 + ppm * 1e-6) * rate_hz) - 0.5) / rate_hz)
            for part, at_s in (("step", edges), ("dir", turns))
        ]
        made.append(AxisSignals(name, lines[0], lines[1], None, float(edges.max(initial=0.0)) + 0.01))
    return made


class Case(NamedTuple):
    """A made capture beside its plan.

    `place` says what is wrong: the axis, the number of steps that its count is off, and the instant of the first pulse
    in question; the axis is -1 for faults that are none of one axis.
    """

    rule: str
    signals: list[AxisSignals]
    expected: Expectation
    resolution_s: float
    place: tuple[int, int, float]


FAULTS = (
    "lost 1",
    "extra 1",
    "lost 5",
    "extra 3",
    "lost 40",
    "two axes lose 1",
    "stroke left out",
    "swapped",
    "inverted",
    "scaled",
    "dead",
)
CANCELLING = ("lost and extra", "lost both ways")
RULES_MADE = tuple(CONTROLLERS_MADE)


def made_case(seed: int, fault: str = "", rule: str = "", size: float = 8.0) -> Case:
    """Return a capture of a random path, law, controller, sampling rate, drift and jitter, with a fault or none."""
    random = np.random.default_rng(seed)
    path = random_path(random, size)
    while fault in ("swapped", "two axes lose 1") and path[0].shape[1] < 2:
        path = random_path(random, size)
    rule = rule or RULES_MADE[seed % len(RULES_MADE)]
    law = Law(random.uniform(20.0, 150.0), random.uniform(300.0, 4000.0))
    per_mm = float(random.choice([80.0, 100.0, 160.0]))
    rate_hz = float(random.choice([24e6, 8e6, 1e6]))
    drawn = path
    if fault == "stroke left out":
        keep = int(random.integers(len(path) - 2)) if len(path) > 2 else 0
        joined = np.vstack([path[keep][:1], path[min(keep + 1, len(path) - 1)][-1:]])
        drawn = [*path[:keep], joined, *path[keep + 2 :]]
    steps = CONTROLLERS_MADE[rule](Drawn(drawn, law, float(random.choice([0.0, 0.02]))), per_mm, random)
    steps, place = _damaged(steps, fault, random)
    jitter_s = 2e-7 if rule == "marlin" else float(random.choice([0.0, 2e-6]))
    made = signals(steps, rate_hz, float(random.choice([0.0, 50.0, -80.0])), jitter_s, seed)
    return Case(rule, made, Drawn(path, Law(50.0, 500.0)).expected(per_mm), 1.0 / rate_hz, place)


def _damaged(steps: list[Steps], fault: str, random: np.random.Generator) -> tuple[list[Steps], tuple[int, int, float]]:
    turning = fault == "lost both ways"
    long = [axis for axis, own in enumerate(steps) if own.time_s.size > 100 and (np.ptp(own.signs) or not turning)]
    axis = int(random.choice(long))
    own = steps[axis]
    first = int(random.integers(own.time_s.size - 50))
    count = int(fault.rsplit(maxsplit=1)[-1]) if fault[-1:].isdigit() else 0
    if fault.startswith("lost ") and count:
        off = -int(own.signs[first : first + count].sum())
        return change(steps, axis, lose(own, first, count)), (axis, off, float(own.time_s[first]))
    if fault.startswith("extra"):
        while own.signs[first] != own.signs[first + 1]:
            first += 1
        return change(steps, axis, add(own, first, count)), (
            axis,
            count * int(own.signs[first]),
            float(own.time_s[first]),
        )
    if fault == "two axes lose 1":
        for axis in long[:2]:
            steps = change(steps, axis, lose(steps[axis], int(random.integers(steps[axis].time_s.size)), 1))
    if fault == "lost and extra":
        return change(steps, axis, lose(add(own, first + 40), first, 1)), (axis, 0, float(own.time_s[first]))
    if fault == "lost both ways":
        up, down = (random.choice(np.flatnonzero(own.signs == sign)) for sign in (1, -1))
        kept = np.delete(np.arange(own.time_s.size), [up, down])
        return change(steps, axis, Steps(own.time_s[kept], own.signs[kept])), (axis, 0, float(own.time_s[up]))
    if fault == "swapped":
        other = next(each for each in range(len(steps)) if each != axis)
        steps = change(change(steps, axis, steps[other]), other, own)
    if fault == "inverted":
        steps = change(steps, axis, Steps(own.time_s, (-own.signs).astype(np.int8)))
    if fault == "scaled":
        kept = np.arange(own.time_s.size) % 5 != 0
        steps = change(steps, axis, Steps(own.time_s[kept], own.signs[kept]))
    if fault == "dead":
        steps = change(steps, axis, lose(own, 0, own.time_s.size))
    return steps, (axis, 0, 0.0)
