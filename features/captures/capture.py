"""A capture: what a logic analyser has recorded of each of its channels."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import digits_in

CHANNELS_MAX: Final = 64
"""Channels of a capture; a sample of more does not fit into 8 bytes."""
LASTS_S_MAX: Final = 1e9
"""Longest capture: 31 years, whose instants are whole numbers of every unit that is read and of the board's counts."""
CHANGES_MAX: Final = 40_000_000
"""Changes of all channels together: ten minutes of four axes at 4 kHz have 20 million, which take 160 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One channel: its level at the beginning, and the instants when it changes.

    Attributes:
        name: as the file names it.
        level: at the beginning, 0 or 1.
        edges: shape (n,), instants of the changes in the capture's ticks, rising; each inverts the level.
    """

    name: str
    level: int
    edges: Int64Array

    def level_after(self, edge: int) -> int:
        """Return the level after an edge, given by its index; -1: before the first."""
        return self.level ^ ((edge + 1) & 1)


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """The channels of one recording.

    Attributes:
        kind: format of the file, in words.
        channels: in the order of the file.
        tick_s: unit of its instants.
        ticks: how long it lasts.
        rate_hz: sampling rate, if the file tells it or the user has said it.
        sampled: instants are numbers of samples: a change that sample n shows came half a sample before it, on average.
        told: one line for each kind of thing in the file that was left out or taken for something, with its number.
    """

    kind: str
    channels: tuple[Channel, ...]
    tick_s: float
    ticks: int
    rate_hz: float | None
    sampled: bool = False
    told: tuple[str, ...] = ()

    @property
    def duration_s(self) -> float:
        """How long it lasts."""
        return self.ticks * self.tick_s

    @property
    def resolution_s(self) -> float:
        """How far apart two instants may be that look the same: a sample.

        Raises:
            InputError: the file does not tell its sampling rate.
        """
        if self.rate_hz is None:
            raise InputError(f"{self.kind} does not tell its sampling rate: rate=24MHz says it")
        return 1.0 / self.rate_hz

    def times_s(self, edges: Int64Array) -> FloatArray:
        """Return instants in seconds since the beginning."""
        times_s: FloatArray = (edges.astype(np.float64) - (0.5 if self.sampled else 0.0)) * self.tick_s
        return times_s

    def channel(self, name: str) -> Channel:
        """Return a channel by its name, or by its number as D0, CH0 or 0; raise InputError if it has none."""
        by_name = {channel.name.lower(): channel for channel in self.channels}
        if found := by_name.get(name.strip().lower()):
            return found
        digits = name.strip().upper().removeprefix("CH").removeprefix("D")
        number = digits_in(digits)
        if number is not None and number < len(self.channels):
            return self.channels[number]
        raise unknown("channel", name, [channel.name for channel in self.channels])


def changes_of(values: Int64Array, at: Int64Array, names: Iterable[str]) -> tuple[Channel, ...]:
    """Return the channels of a record of samples, bit by bit.

    Args:
        values: shape (n,), the first sample and each that differs from the one before, channel k in bit k.
        at: shape (n,), their numbers, the first of them 0.
        names: the channels' names.
    """
    channels = []
    for bit, name in enumerate(names):
        levels = (values >> bit) & 1
        edges = np.flatnonzero(levels[1:] != levels[:-1]) + 1
        channels.append(Channel(shortened(name), int(levels[0]) if levels.size else 0, at[edges]))
    return tuple(channels)


def check_channels(count: int) -> None:
    """Raise InputError for more channels than can be read."""
    if not 1 <= count <= CHANNELS_MAX:
        raise InputError(f"has {count} channels; 1 to {CHANNELS_MAX} can be read")


def check_lasts(lasts_s: float) -> None:
    """Raise InputError for instants that lie too far apart, or are no numbers."""
    if not lasts_s <= LASTS_S_MAX:
        raise InputError(f"lasts {lasts_s:g} s: at most {LASTS_S_MAX:g} s, 31 years, can be read")


def check_changes(count: int) -> None:
    """Raise InputError for more changes than can be held."""
    if count > CHANGES_MAX:
        raise InputError(
            f"its channels change more than {CHANGES_MAX} times: record only those of STEP, DIR and ENABLE"
        )
