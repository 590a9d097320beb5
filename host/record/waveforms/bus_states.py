"""Read the drives' states over time from the bus log: each node sends its statusword in its first PDO."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.common.errors import InputError
from steptwin.host.record.bus_log import read_frames
from steptwin.host.record.waveforms.signal import HeldValues
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_TPDO, FIRST_NODE_ID
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.pdo_defaults import TPDO_DEFAULTS

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
