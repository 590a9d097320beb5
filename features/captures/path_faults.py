"""Find where counts of steps leave a path, and what explains it: pulses lost or extra, a part left out."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.captures.path_walk import Events, ReachedPlaces, agreeing, counts_after, reach, reach_back
from steptwin.features.captures.step_rules import StepRule
from steptwin.host.common.arrays import BoolArray, FloatArray, Int64Array

FAULTS_MAX: Final = 8
_LIVES_EVENTS: Final = 200
"""Events that an explanation has to hold on: lines of a single axis let anything live for a while."""
_SEEN_EVENTS: Final = 4000
"""Events after a fault within which explanations are compared."""
_LAYERS: Final = (1, 3, 10)
"""Pulses in a row that may be lost or extra, tried one after another."""
_LAYERS_MAX: Final = 300
"""Most of them, if the count at the end says how many."""
_LONGER_STEPS: Final = 8.0
"""By how many steps a detour is longer than the part of the path in place of which it is."""
_ALL_RIGHT: Final = 2
_SETS_MAX: Final = 4_000_000
"""Sets of places that are kept at once, by events and pulses, which bounds the memory."""
_TURN_STEPS: Final = 4.0
"""Shortest way between two turning points."""
_LEAPS_MAX: Final = 10
_ROUNDING: Final = 1e-6
"""Rounding error of a place."""


class FaultKind(StrEnum):
    """What is wrong."""

    LOST = "lost"
    EXTRA = "extra"
    LOST_OR_EXTRA = "lost or extra"
    LEFT_OUT = "left out"
    DETOUR = "detour"
    LEAVES = "leaves the path"
    UNFINISHED = "unfinished"
    TURN = "turns elsewhere"
    END = "ends elsewhere"
    NOTHING = "nothing recorded"
    DEAD = "dead axis"
    SWAPPED = "swapped"
    INVERTED = "inverted"
    SCALED = "scaled"
    BOTH_EDGES = "both edges"
    MORE = "more faults"


WHOLE: Final = frozenset(list(FaultKind)[list(FaultKind).index(FaultKind.NOTHING) :])
"""Faults of whole axes, and further ones: they have no place."""


class PathFault(NamedTuple):
    """A fault.

    Attributes:
        kind: what is wrong.
        axis: number of the axis; -1: all axes, or no one alone.
        steps: by how much its count is off from there on; 0 if that says nothing.
        events: numbers of events before the fault: at least, and at most.
        places: on the path, as numbers of its vertices: at least, and at most.
        pulse_s: instant of the very pulse, as its neighbours tell it; None: they do not.
        other: number of the other axis of two that are swapped.
        scale: ratio of the counts of a scaled axis.
        sign: direction of the axis' motion there, +1 or -1; 0: both.
    """

    kind: FaultKind
    axis: int = -1
    steps: int = 0
    events: tuple[int, int] = (0, 0)
    places: tuple[float, float] = (0.0, 0.0)
    pulse_s: float | None = None
    other: int = -1
    scale: float = 1.0
    sign: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """A path and the events of a capture that should follow it, by a rule.

    Attributes:
        points: shape (axes, vertices), the path in steps.
        events: steps of the capture.
        rule: the step rule.
        half_steps: largest distance of a count from the path's middle.
    """

    points: FloatArray
    events: Events
    rule: StepRule
    half_steps: float

    @property
    def end(self) -> float:
        """The last place of the path."""
        return float(self.points.shape[1] - 1)

    @property
    def middle(self) -> FloatArray:
        """The path on which counts lie by the rule, on average."""
        return self.points + self.rule.middle_steps

    def count(self, event: int) -> FloatArray:
        """Return the counts after an event."""
        return counts_after(self.events.changes, event, self.rule.start(self.points[:, 0]))

    def steps_between(self, begin: float, end: float) -> float:
        """Return how many steps all axes go between two places."""
        vertices = np.arange(self.points.shape[1])
        places = np.concatenate(([begin], vertices[(vertices > begin) & (vertices < end)], [end]))
        return sum(float(np.abs(np.diff(np.interp(places, vertices, points))).sum()) for points in self.points)

    def right_at_the_end(self, off: FloatArray) -> BoolArray:
        """Return which axes' last counts are right, if they are corrected."""
        return self.rule.rests(self.count(len(self.events.changes)) + off, self.points[:, -1])

    def reach(self, event: int, off: FloatArray, begin: tuple[float, float], until: int | None = None) -> ReachedPlaces:
        """Return where the machine may be after an event and those behind it."""
        changes = self.events.changes[event:until]
        return reach(self.middle, self.half_steps, changes, self.count(event) + off, begin)

    def is_whole(self, reached: ReachedPlaces) -> bool:
        """Return whether all events were walked, and the path to its end."""
        last = len(reached.lows) - 1
        return reached.events() == last and reached.at(last)[1] >= self.end - _ROUNDING

    def passes(self) -> bool:
        """Return whether the events walk the path by the rule."""
        off = np.zeros(len(self.points))
        return (
            bool(self.right_at_the_end(off).all())
            and self.is_whole(self.reach(0, off, (0.0, 0.0)))
            and not any(self.wrong_turns())
        )

    def wrong_turns(self) -> Iterator[PathFault]:
        """Yield each turning point of an axis at which its count is not that of the path."""
        counts = self.rule.start(self.points[:, 0])
        for axis, points in enumerate(self.points):
            own = np.flatnonzero(self.events.changes[:, axis])
            made = counts[axis] + np.concatenate(([0], np.cumsum(self.events.changes[own, axis], dtype=np.int64)))
            planned, turned = _turning(points), _turning(made)
            if planned.size != turned.size:
                continue  # of turns about as short as the shortest the path tells
            right = self.rule.turns(made[turned], points[planned])
            for i in np.flatnonzero(~right).tolist():
                off = round(float(made[turned[i]] - points[planned[i]]))
                event = int(own[turned[i] - 1]) + 1
                place = float(planned[i])
                yield PathFault(FaultKind.TURN, axis, off, (event, event), (place, place))


def faults(walk: Walk) -> list[PathFault]:
    """Return what explains that the events do not walk the path, in order; empty if they do."""
    found: list[PathFault] = []
    off, event, begin = np.zeros(len(walk.points)), 0, (0.0, 0.0)
    while True:
        reached = walk.reach(event, off, begin)
        whole = walk.is_whole(reached)
        if whole and walk.right_at_the_end(off).all():
            return found or list(walk.wrong_turns())[:FAULTS_MAX]
        if len(found) == FAULTS_MAX:
            return [*found, PathFault(FaultKind.MORE)]
        stop = reached.events()
        if jump := _jump(walk, event, off, reached, whole=whole):
            fault, begin = jump
            found.append(fault)
            off[fault.axis] -= fault.steps
            event = fault.events[1] + 1
            continue
        at = max(event + stop, 0)
        place = reached.at(max(stop, 0))[1]
        if whole or at == len(walk.events.changes):
            return [*found, *_at_the_end(walk, off, place, whole=whole)]
        leap = _leap(walk, at, off, place)
        if leap is None:
            return [*found, PathFault(FaultKind.LEAVES, events=(at, at), places=(place, walk.end))]
        event, begin, more = leap
        made = int(np.abs(walk.events.changes[at:event]).sum(dtype=np.int64))
        is_longer = made > walk.steps_between(place, begin[0]) + _LONGER_STEPS
        axis = int(np.abs(more).argmax()) if more.any() else -1
        steps = -int(more[axis]) if more.any() else 0
        kind = FaultKind.LOST_OR_EXTRA if steps else FaultKind.DETOUR if is_longer else FaultKind.LEFT_OUT
        found.append(PathFault(kind, axis, steps, (at, event), (place, max(begin[0], place))))
        off += more


def _at_the_end(walk: Walk, off: FloatArray, place: float, *, whole: bool) -> Iterator[PathFault]:
    """Yield what is wrong where nothing explains wrong counts at the end, or that the path's end is not reached."""
    last = len(walk.events.changes)
    if not whole:
        yield PathFault(FaultKind.UNFINISHED, events=(last, last), places=(place, walk.end))
        return
    counts, positions = walk.count(last) + off, walk.points[:, -1]
    for axis in np.flatnonzero(~walk.rule.rests(counts, positions)).tolist():
        steps = round(float(counts[axis] - positions[axis]))
        yield PathFault(FaultKind.END, axis, steps, (last, last), (walk.end, walk.end))


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """Pulses of one axis, lost or extra, as an explanation, and how far it goes.

    Attributes:
        axis: the axis.
        sign: what one pulse is short by.
        count: their number.
        event: number of events before it is tried.
        reached: the places with 0 to `count` of them, or more.
        alive: number of events after which it has places at last.
        ends: 1 if the path's end is reached with the axis' right count there, `_ALL_RIGHT` if all counts are right.
    """

    axis: int
    sign: int
    count: int
    event: int
    reached: ReachedPlaces
    alive: int
    ends: int


def _jump(
    walk: Walk, event: int, off: FloatArray, reached: ReachedPlaces, *, whole: bool
) -> tuple[PathFault, tuple[float, float]] | None:
    """Return the pulses, lost or extra, that explain most, and the places behind them; None if none explain enough.

    The counts at the end say which axis is short, if it is only one. Where the whole path was walked, none else is.
    """
    stop, last = reached.events(), len(walk.events.changes)
    short = np.rint(walk.points[:, -1] - walk.count(last) - off)
    own = [(axis, int(np.sign(short[axis])), int(abs(short[axis]))) for axis in np.flatnonzero(short).tolist()]
    both = [(axis, sign) for axis in range(len(off)) for sign in (1, -1) if not whole or short[axis] * sign > 0.0]
    tries = [[(axis, sign, layers) for axis, sign in both] for layers in _LAYERS]
    if event + stop < last:
        tries.append([each for each in own if each[2] > _LAYERS[-1]])
    if len(own) == 1:
        tries.insert(0, own)
    for tried in tries:
        trials: list[_Trial] = []
        for axis, sign, layers in tried:
            if layers > _LAYERS_MAX:
                continue
            held = _SETS_MAX // (layers + 1)
            back = max(stop - held, 0)
            until = min(last, event + stop + (held if tried is own else min(held, _SEEN_EVENTS)))
            trials += _trials(walk, event + back, off, reached.at(back), (axis, sign, layers), until)
        enough = [each for each in trials if each.ends or each.alive >= event + stop + _LIVES_EVENTS]
        if tried is own:
            enough = [each for each in enough if each.ends == _ALL_RIGHT]
        if enough:
            return _located(walk, off, max(enough, key=lambda each: (each.ends, each.alive, -each.count)))
    return None


def _trials(
    walk: Walk, event: int, off: FloatArray, begin: tuple[float, float], lost: tuple[int, int, int], until: int
) -> Iterator[_Trial]:
    """Yield up to so many pulses of an axis, each as an explanation."""
    axis, sign, layers = lost
    changes = walk.events.changes[event:until]
    reached = reach(walk.middle, walk.half_steps, changes, walk.count(event) + off, begin, axis, sign, layers)
    for count in range(1, layers + 1):
        alive = reached.events(count)
        ends = 0
        if event + alive == len(walk.events.changes) and reached.at(alive, count)[1] >= walk.end - _ROUNDING:
            corrected = off.copy()
            corrected[axis] += sign * count
            right = walk.right_at_the_end(corrected)
            ends = int(right[axis]) + int(right.all())
        yield _Trial(axis, sign, count, event, reached, event + alive, ends)


def _located(walk: Walk, off: FloatArray, trial: _Trial) -> tuple[PathFault, tuple[float, float]] | None:
    """Return the fault between the first and the last event that it may come behind, and the places behind it.

    None if its pulses have no place, which hulls instead of sets of places hide.
    """
    axis, sign, count, event, reached = trial.axis, trial.sign, trial.count, trial.event, trial.reached
    alive = trial.alive - event
    corrected = walk.count(trial.alive) + off
    corrected[axis] += sign * count
    goal = (walk.end, walk.end) if trial.ends else reached.at(alive, count)
    changes = walk.events.changes[event : trial.alive]
    back = reach_back(walk.middle, walk.half_steps, changes, corrected, goal, axis=axis, sign=sign, layers=count)
    first = _meeting(reached, 0, back, 1)
    last = _meeting(reached, count - 1, back, count)
    if not (first.size and last.size):
        return None
    a, b = int(first[0]), max(int(last[-1]), int(first[0]))
    behind = min(b + 1, alive)
    own = np.flatnonzero(walk.events.changes[:, axis])
    window = slice(*np.searchsorted(own, (event + a, event + b + 1)).tolist())
    pulses = walk.events.changes[own[max(window.start - 1, 0) : window.stop + 1], axis]
    up, down = int((pulses > 0).sum()), int((pulses < 0).sum())
    both = min(up, down) > 0.02 * max(up, down)
    ways = [sign, -sign] if both else [1 if up >= down else -1]
    near = own[max(window.start - 4, 0) : window.stop + 4]
    seen = {way: at_s for way in ways if (at_s := _pulse(walk.events, near, (event + a, event + b), trial, way))}
    if len(seen) == 1 or not both:
        way = next(iter(seen), ways[0])
        kind = FaultKind.LOST if way == sign else FaultKind.EXTRA
    else:
        way, kind = 0, FaultKind.LOST_OR_EXTRA
    pulse_s = seen.get(way)
    if pulse_s is not None:
        a = b = min(max(int(np.searchsorted(walk.events.time_s, pulse_s)) - event, a), b)
    low = max(reached.at(a)[0], float(back.lows[a : a + 2, 1].min()))
    high = min(reached.at(b, count - 1)[1], float(back.highs[b : b + 2, count].max()))
    places = (low, max(low, high))
    fault = PathFault(kind, axis, -sign * count, (event + a, event + behind - 1), places, pulse_s, sign=way)
    return fault, reached.at(behind, count)


def _meeting(forward: ReachedPlaces, layer: int, back: ReachedPlaces, next_layer: int) -> Int64Array:
    """Return the events behind which a pulse may be lost, or the next of which may be an extra one."""

    def overlap(later: int) -> Int64Array:
        low, high = (bounds[: len(back.lows) - later, layer] for bounds in forward)
        next_low, next_high = (bounds[later:, next_layer] for bounds in back)
        met = np.maximum(low, next_low) <= np.minimum(high, next_high) + _ROUNDING
        return np.flatnonzero(met & (low <= high) & (next_low <= next_high))

    return np.union1d(overlap(0), overlap(1))


def _pulse(events: Events, near: Int64Array, window: tuple[int, int], trial: _Trial, way: int) -> float | None:
    """Return when a pulse is missing or too many, if one interval between the pulses near it says so.

    Around lost ones it is longer than its neighbours by so many intervals; around an extra one there are two for one.
    """
    axis = trial.axis
    if near.size < 6:
        return None
    gap = np.diff(events.time_s[near])
    same = events.changes[near[1:], axis] == events.changes[near[:-1], axis]
    inside = (near[1:] > window[0]) & (near[:-1] <= window[1]) & (events.changes[near[1:], axis] == way) & same
    before, middle, after = gap[:-2], gap[1:-1], gap[2:]
    if way == trial.sign:
        times = trial.count + 1
        longest, shortest = np.maximum(before, after), np.minimum(before, after)
        alike = inside[1:-1] & same[:-2] & same[2:]
        found = np.flatnonzero(alike & (middle > 0.7 * times * longest) & (middle < 1.45 * times * shortest))
        if not 0 < found.size <= 3:
            return None
        best = found[np.argmax((middle / longest)[found])]
        return float(events.time_s[near[best + 1]] + middle[best] / times)
    if gap.size < 4 or trial.count > 1:
        return None
    two, one, other = gap[1:-2] + gap[2:-1], gap[:-3], gap[3:]
    alike = inside[1:-2] & same[:-3] & same[2:-1] & same[3:]
    shortest, longest = np.minimum(one, other), np.maximum(one, other)
    found = np.flatnonzero(alike & (two > 0.77 * shortest) & (two < 1.3 * longest) & (longest < 1.3 * shortest))
    return float(events.time_s[near[found[0] + 2]]) if 0 < found.size <= 3 else None


def _leap(walk: Walk, at: int, off: FloatArray, place: float) -> tuple[int, tuple[float, float], FloatArray] | None:
    """Return the first event, behind one, from which the path is walked again, the places then, and the correction.

    The places are not before `place`. The correction is none, or what one axis is short by at the end. None: the path
    is never walked again.
    """
    last = len(walk.events.changes)
    short = np.rint(walk.points[:, -1] - walk.count(last) - off)
    corrections = [np.zeros(len(off)), *(row for row in np.diag(short) if np.abs(row).max() > _LAYERS[-1])]
    event, step = at + 1, 1
    while event <= last:
        for more in corrections:
            count = walk.count(event) + off + more
            for begin in agreeing(walk.middle, walk.half_steps, count, place)[:_LEAPS_MAX]:
                reached = walk.reach(event, off + more, begin, event + _LIVES_EVENTS)
                lives = reached.events()
                if lives == _LIVES_EVENTS or (event + lives == last and reached.at(lives)[1] >= walk.end - _ROUNDING):
                    changes = walk.events.changes[at:event]
                    back = reach_back(walk.middle, walk.half_steps, changes, count, begin)
                    first = int(np.argmax((back.highs >= back.lows) & (back.highs >= place)))
                    low, high = back.at(first)
                    return at + first, (max(low, place), high), more
        event, step = event + step, int(step * 1.3) + 1
    return None


def gross_faults(walk: Walk) -> list[PathFault]:
    """Return what is wrong with whole axes, by their runs between turning points.

    An axis may be dead, go another one's path, turn the other way, or be of another scale.
    """
    if not walk.events.changes.any():
        return [PathFault(FaultKind.NOTHING)]
    axes = range(len(walk.points))
    planned = [_runs(points) for points in walk.points]
    made = [_runs(np.cumsum(np.append(0.0, changes))) for changes in walk.events.changes.T]
    scales = [[_scale(planned[i], made[j]) for j in axes] for i in axes]
    found = []
    for i in axes:
        own = scales[i][i]
        others = [j for j in axes if j != i and _is_one(scales[i][j]) and _is_one(scales[j][i])]
        if not made[i].size and np.abs(planned[i]).sum() > _DEAD_STEPS:
            found.append(PathFault(FaultKind.DEAD, i))
        elif others and not _is_one(own):
            found += [PathFault(FaultKind.SWAPPED, i, other=others[0])] if i < others[0] else []
        elif own is not None and abs(own + 1.0) < _SCALE_OFF:
            found.append(PathFault(FaultKind.INVERTED, i))
        elif own is not None and not _is_one(own) and np.abs(planned[i]).sum() > _SCALED_STEPS:
            found.append(PathFault(FaultKind.SCALED, i, scale=own))
    return found


_DEAD_STEPS: Final = 3.0
_SCALED_STEPS: Final = 100.0
_SCALE_OFF: Final = 0.02
"""Difference of a scale from 1 that lost pulses explain."""


def _is_one(scale: float | None) -> bool:
    return scale is not None and abs(scale - 1.0) <= _SCALE_OFF


def _runs(values: FloatArray) -> FloatArray:
    """Return how far values go between turning points."""
    least = max(_TURN_STEPS, 0.02 * float(np.ptp(values)))
    return np.diff(values[[0, *_turning(values, least), -1]]) if np.any(values != values[0]) else np.empty(0)


def _scale(planned: FloatArray, made: FloatArray) -> float | None:
    """Return by which factor an axis goes further than planned in each run; None if it does not."""
    if not planned.size or planned.size != made.size:
        return None
    scale = float(planned @ made / (planned @ planned))
    off = np.abs(made - scale * planned)
    return scale if np.all(off <= 2.0 + 0.01 * np.abs(made)) and scale != 0.0 else None


def _turning(values: FloatArray, least: float = _TURN_STEPS) -> Int64Array:
    """Return where values turn around, with at least so much between two turning points."""
    moves = np.diff(values)
    moving = np.flatnonzero(moves)
    turns = moving[np.flatnonzero(np.diff(np.sign(moves[moving])))] + 1
    found: list[int] = []
    top = bottom = 0
    way = 0
    for i in [*turns.tolist(), len(values) - 1]:
        top = i if values[i] > values[top] else top
        bottom = i if values[i] < values[bottom] else bottom
        if way >= 0 and values[top] - values[i] >= least:
            if way > 0 or top > 0:
                found.append(top)
            way, bottom = -1, i
            top = i
        elif way <= 0 and values[i] - values[bottom] >= least:
            if way < 0 or bottom > 0:
                found.append(bottom)
            way, top = 1, i
            bottom = i
    return np.array(found, np.int64)
