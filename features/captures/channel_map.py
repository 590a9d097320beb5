"""Wire a capture's channels to the axes of a robot, STEP, DIR and, if recorded, ENABLE of each; say what channels do.

`th1=D0,D1` and `th2=D2,!D3,D6` name the channels of an axis in this order; `!` inverts one. Without a map the channels'
own names tell it if they are those of StepTwin's waveforms, such as `th1_step`. The facts of a capture are its
channels, how fast they change, their shortest pulses, and which look like a pair: STEP has many short pulses of one
width; DIR changes rarely, and while STEP rests.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.features.captures.capture import Capture, Channel
from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError

_PARTS: Final = ("step", "dir", "enable")
_SHORT_PART: Final = 0.1
"""A pulse shorter than this part of the axis' median looks like a glitch."""
_PULSES_OF_STEP: Final = 20


class ProbeLine(NamedTuple):
    """A channel as an axis sees it: inverted or not, and without the glitches that were dropped."""

    name: str
    level: int
    times_s: FloatArray
    glitches: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class AxisSignals:
    """The signals of one axis; all instants are in seconds since the capture's beginning.

    Attributes:
        name: of the axis.
        step: STEP.
        direction: DIR.
        enable: ENABLE; None: it was not recorded.
        end_s: when the capture ends.
    """

    name: str
    step: ProbeLine
    direction: ProbeLine
    enable: ProbeLine | None
    end_s: float

    @property
    def rises_s(self) -> FloatArray:
        """The rises of STEP, shape (pulses,)."""
        return self._edges()[0::2]

    @property
    def falls_s(self) -> FloatArray:
        """The fall that ends each pulse; the capture's end for one that has not ended, shape (pulses,)."""
        falls_s = self._edges()[1::2]
        return np.append(falls_s, self.end_s) if self.rests_high else falls_s

    @property
    def rests_high(self) -> bool:
        """Whether the last pulse has not ended."""
        return bool(self._edges().size % 2)

    def _edges(self) -> FloatArray:
        """Return the edges from the first rise on: of a pulse that began before the capture its fall is no pulse."""
        return self.step.times_s[self.step.level & 1 :]

    def inverted(self) -> "AxisSignals":
        """Return the signals with STEP inverted, for a driver that steps at its falls: they are rises then."""
        return replace(self, step=self.step._replace(level=self.step.level ^ 1))

    @property
    def exchanged(self) -> bool:
        """Whether STEP looks like a DIR, and DIR like a STEP: far more pulses are on DIR."""
        return self.direction.times_s.size > _PULSES_OF_STEP + 4 * self.step.times_s.size

    @property
    def glitches(self) -> int:
        """Number of glitches that were dropped."""
        return self.step.glitches + self.direction.glitches + (self.enable.glitches if self.enable else 0)

    @property
    def suspicious(self) -> int:
        """Number of pulses that look like glitches: far shorter than most."""
        whole = self.rises_s.size - self.rests_high
        widths_s = self.falls_s[:whole] - self.rises_s[:whole]
        return int(np.count_nonzero(widths_s < _SHORT_PART * np.median(widths_s))) if widths_s.size else 0

    def signs_at(self, times_s: FloatArray) -> Int8Array:
        """Return the direction of a step at each instant: +1 with DIR high, -1 with DIR low."""
        passed = np.searchsorted(self.direction.times_s, times_s, side="right")
        signs: Int8Array = (2 * ((self.direction.level + passed) & 1) - 1).astype(np.int8)
        return signs


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """Which channels an axis has, by their names in the file."""

    axis: str
    step: str
    direction: str
    enable: str | None = None

    @classmethod
    def read(cls, text: str, axes: Sequence[str]) -> "ChannelMap":
        """Return what a text such as `th1=D0,D1` says; raise InputError for another."""
        axis, equals, channels = text.partition("=")
        names = [name.strip() for name in channels.split(",")]
        if not equals or not 2 <= len(names) <= len(_PARTS) or not all(names):
            raise InputError(f"map={text}: is not AXIS=STEP,DIR or AXIS=STEP,DIR,ENABLE, such as {axes[0]}=D0,D1")
        if axis.strip() not in axes:
            raise unknown(f"map={text}: axis", axis.strip(), axes)
        return cls(axis.strip(), *names)

    def __str__(self) -> str:
        return f"{self.axis}={','.join(name for name in (self.step, self.direction, self.enable) if name)}"


def wired(
    capture: Capture, axes: Sequence[str], maps: Sequence[str] = (), glitch_s: float = 0.0
) -> tuple[tuple[AxisSignals, ...], tuple[ChannelMap, ...]]:
    """Return the signals of each axis in order, and the wiring.

    Args:
        capture: the capture.
        axes: names of all axes of the robot.
        maps: one text an axis, or none if the channels' names tell it.
        glitch_s: two edges of a channel that are closer are dropped, and counted.

    Raises:
        InputError: an axis has no channels, or two, or two axes share one.
    """
    wirings = _named(capture, axes) if not maps else [ChannelMap.read(text, axes) for text in maps]
    by_axis = {wiring.axis: wiring for wiring in wirings}
    if len(by_axis) < len(wirings):
        double = next(wiring for wiring in wirings if by_axis[wiring.axis] is not wiring)
        raise InputError(f"map={double}: {double.axis} has channels already")
    for axis in axes:
        if axis not in by_axis:
            raise InputError(f"map: {axis} has no channels; map={axis}=STEP,DIR names them")
    made = tuple(_signals(capture, by_axis[axis], glitch_s) for axis in axes)
    used = [wire.name for axis in made for wire in (axis.step, axis.direction)]
    if len(set(used)) < len(used):
        raise InputError(f"map: channel {next(name for name in used if used.count(name) > 1)} is named twice")
    return made, tuple(by_axis[axis] for axis in axes)


def _named(capture: Capture, axes: Sequence[str]) -> list[ChannelMap]:
    """Return the wiring that channels' names such as th1_step tell."""
    own = {channel.name.lower() for channel in capture.channels}
    names = {axis: [f"{axis}_{part}".lower() for part in _PARTS] for axis in axes}
    missing = [name for axis in axes for name in names[axis][:2] if name not in own]
    if missing:
        raise InputError(
            f"no channel is called {missing[0]}: map={axes[0]}=STEP,DIR names those of each axis, such as"
            f" map={axes[0]}={','.join(channel.name for channel in capture.channels[:2])}"
        )
    return [
        ChannelMap(axis, step, direction, enable if enable in own else None)
        for axis, (step, direction, enable) in names.items()
    ]


def _signals(capture: Capture, wiring: ChannelMap, glitch_s: float) -> AxisSignals:
    with prefixed(f"map={wiring}: "):
        step, direction = (_wire(capture, name, glitch_s) for name in (wiring.step, wiring.direction))
        enable = None if wiring.enable is None else _wire(capture, wiring.enable, glitch_s)
    return AxisSignals(wiring.axis, step, direction, enable, capture.duration_s)


def _wire(capture: Capture, name: str, glitch_s: float) -> ProbeLine:
    channel = capture.channel(name.removeprefix("!"))
    times_s = capture.times_s(channel.edges)
    kept = _without_glitches(times_s, glitch_s)
    dropped = (times_s.size - kept.size) // 2
    return ProbeLine(channel.name, channel.level ^ name.startswith("!"), kept, dropped)


def _without_glitches(times_s: FloatArray, glitch_s: float) -> FloatArray:
    """Return the edges without pairs that are closer than `glitch_s`, taken in order of time."""
    close = np.flatnonzero(np.diff(times_s) < glitch_s)
    if not close.size:
        return times_s
    dropped: list[int] = []
    for first in close.tolist():
        if not dropped or first > dropped[-1]:
            dropped += (first, first + 1)
    return np.delete(times_s, dropped)


def pulse_widths_ticks(channel: Channel) -> Int64Array:
    """Return how long each high level lasts whose both ends are on record."""
    edges = channel.edges[channel.level & 1 :]
    whole = edges.size - edges.size % 2
    return edges[1:whole:2] - edges[0:whole:2]


def capture_facts(capture: Capture) -> dict[str, Any]:
    """Return what `steptwin capture` tells."""
    pairs = _pairs(capture)
    return {
        "kind": capture.kind,
        "duration_s": capture.duration_s,
        "rate_hz": capture.rate_hz,
        "channels": [_facts(capture, channel) for channel in capture.channels],
        "pairs": [
            {"step": pair.step, "dir": pair.direction} | ({"or": list(pair.others)} if pair.others else {})
            for pair in pairs
        ],
        "told": list(capture.told),
    }


def _facts(capture: Capture, channel: Channel) -> dict[str, Any]:
    widths = pulse_widths_ticks(channel)
    gaps = np.diff(channel.edges[(channel.level & 1) :: 2])
    return {
        "name": channel.name,
        "first_level": channel.level,
        "edges": int(channel.edges.size),
        "shortest_pulse_us": float(widths.min() * capture.tick_s * 1e6) if widths.size else None,
        "usual_pulse_us": float(np.median(widths) * capture.tick_s * 1e6) if widths.size else None,
        "fastest_hz": float(1.0 / (gaps.min() * capture.tick_s)) if gaps.size and gaps.min() > 0 else None,
    }


class _Pair(NamedTuple):
    """Two channels that look like STEP and DIR of one axis, and others that look like this DIR just as much."""

    step: str
    direction: str
    others: tuple[str, ...]


def _pairs(capture: Capture) -> list[_Pair]:
    """Return the pairs of channels that look like STEP and DIR, each channel once: of one axis, then neighbours."""
    steps = [i for i, channel in enumerate(capture.channels) if channel.edges.size >= 2 * _PULSES_OF_STEP]
    found, taken = [], set[int]()
    busy = {i for i in steps if _is_step(capture.channels[i])}
    for step in sorted(busy):
        pulses = capture.channels[step].edges.size // 2
        fitting = [
            i
            for i, channel in enumerate(capture.channels)
            if i not in busy and channel.edges.size < pulses / 2 and _turns(capture.channels[step], channel)
        ]
        name = capture.channels[step].name
        named = [i for i in fitting if _same_axis(name, capture.channels[i].name)]
        near = [i for i in named or fitting if i not in taken]
        if near:
            direction = min(near, key=lambda i: abs(i - step - 0.5))
            taken.add(direction)
            others = tuple(capture.channels[i].name for i in (named or fitting) if i != direction)
            found.append(_Pair(name, capture.channels[direction].name, others))
    return found


def _same_axis(name: str, other: str) -> bool:
    """Return whether two names, such as th1_step and th1_dir, are of one axis."""
    axis, _, _ = name.rpartition("_")
    return bool(axis) and axis == other.rpartition("_")[0]


def _is_step(channel: Channel) -> bool:
    """Return whether a channel's pulses are short beside their distances, or all of one width."""
    widths = pulse_widths_ticks(channel)
    middle = np.median(widths)
    return bool(np.mean(np.abs(widths - middle) <= 0.25 * middle + 2) > 0.9)


def _turns(step: Channel, direction: Channel) -> bool:
    """Return whether a channel changes between two pulses of STEP, and STEP is at rest then, as a driver asks for."""
    passed = np.searchsorted(step.edges, direction.edges)
    within = (passed > 0) & (passed < step.edges.size)
    levels = (step.level + passed[within]) & 1
    return bool(levels.size and np.bincount(levels, minlength=2).max() == levels.size)
