"""The drives' states as the bus log has them: from the statusword that each node sends in its first PDO."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.common.errors import InputError
from steptwin.host.record.waveforms.signal import HeldValues
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_TPDO, FIRST_NODE_ID
from steptwin.protocol.objects import TPDO_DEFAULTS
from steptwin.protocol.timer import COUNTS_PER_US

STATES: Final = ("UNKNOWN", *(state.name for state in State))
"""What the values mean; nothing is known of a drive before its first PDO."""

_LINE: Final = re.compile(r"\((\d+)\.(\d{6})\) \S+ ([0-9A-F]{3})#([0-9A-F]*)\n?")
_PDO_BYTES: Final = sum(bits for _, _, bits in TPDO_DEFAULTS[0][4]) // 8


def drive_states(log: Path, axes: int) -> tuple[HeldValues, ...]:
    """The state of each axis' drive over time, to the microsecond of the log.

    Raises:
        InputError: a line is not candump's; the message names file and line.
    """
    changes: list[list[tuple[int, int]]] = [[] for _ in range(axes)]
    for counts, cob_id, data in _frames(log):
        axis = cob_id - COB_TPDO[0] - FIRST_NODE_ID
        if 0 <= axis < axes and len(data) == _PDO_BYTES:
            changes[axis].append((counts, _state(int.from_bytes(data[:2], "little"))))
    return tuple(_steps(own) for own in changes)


def _state(statusword: int) -> int:
    """Index of the state; junk on the wire tells nothing."""
    try:
        return STATES.index(State.of(statusword).name)
    except ValueError:
        return 0


def _frames(log: Path) -> Iterator[tuple[int, int, bytes]]:
    with log.open(encoding="ascii", errors="replace") as lines:
        for number, line in enumerate(lines, start=1):
            match = _LINE.fullmatch(line)
            if not match or len(match[4]) % 2:
                raise InputError(f"{log}: line {number}: is not a frame of candump's")
            us = int(match[1]) * 1_000_000 + int(match[2])
            yield us * COUNTS_PER_US, int(match[3], 16), bytes.fromhex(match[4])


def _steps(changes: Sequence[tuple[int, int]]) -> HeldValues:
    counts, states = zip(*changes, strict=True) if changes else ((), ())
    return HeldValues(np.array(counts, np.int64), np.array(states, np.int8))
