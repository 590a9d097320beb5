"""Marks on a run's time axis: violated limits of drivers, outputs, drive states and errors."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.client.words import error_words, state_words
from steptwin.host.common.arrays import Int64Array
from steptwin.host.record.bus_log import read_frames
from steptwin.host.verify import AxisEvidence, DriverViolations, OutputEdge
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_EMCY, COB_TPDO, FIRST_NODE_ID
from steptwin.protocol.objects import ENTRIES, TPDO_DEFAULTS
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

TOGETHER_COUNTS: Final = 20 * COUNTS_PER_MS
"""Largest gap within one mark: violations of one limit, or the same error or state of several drives."""

_LOOK_BACK: Final = 40
"""Number of recent marks that are searched for the same event of other drives: eight drives with all their states."""

_STATUS_BYTES: Final = sum(ENTRIES[address].data_type.size for address in TPDO_DEFAULTS[0].mapping)


class MarkKind(StrEnum):
    """Subject of a mark."""

    VIOLATION = "violation"
    ERROR = "error"
    STATE = "state"
    OUTPUT = "output"


@dataclass(frozen=True, slots=True)
class RunMark:
    """An event at an instant or over a time span, in counts since power-up."""

    kind: MarkKind
    counts: int
    until_counts: int
    who: str
    text: str


def violation_marks(axis: AxisEvidence) -> Iterator[RunMark]:
    """Yield a mark for each group of violations of one limit."""
    violations = axis.violations
    for index, limit in enumerate(violations.limits):
        chosen = np.flatnonzero(violations.which == index)
        for stretch in _stretches(violations.counts[chosen]):
            yield _violation(
                axis.name, violations, chosen[stretch], f"{limit.broken}: limit {limit.limit:g} {limit.unit}"
            )


def _violation(name: str, violations: DriverViolations, chosen: Int64Array, broken: str) -> RunMark:
    limit = violations.limits[int(violations.which[chosen[0]])]
    values = violations.values[chosen]
    worst = float(values[np.abs(values - limit.limit).argmax()])
    times = f", {chosen.size} times, at worst" if chosen.size > 1 else ", it was"
    first, last = violations.counts[chosen[[0, -1]]].tolist()
    return RunMark(MarkKind.VIOLATION, first, last, name, f"{broken}{times} {worst:g} {limit.unit}")


def _stretches(counts: Int64Array) -> Iterator[slice]:
    """Yield the groups of sorted instants without gaps above TOGETHER_COUNTS."""
    ends = [*(np.flatnonzero(np.diff(counts) > TOGETHER_COUNTS) + 1).tolist(), counts.size]
    first = 0
    for end in ends:
        if end > first:
            yield slice(first, end)
        first = end


def output_marks(changes: tuple[OutputEdge, ...]) -> Iterator[RunMark]:
    """Yield a mark for each change of an output."""
    for change in changes:
        word = "on" if change.level else "off"
        yield RunMark(MarkKind.OUTPUT, change.counts, change.counts, change.name, word)


def bus_marks(log: Path, names: tuple[str, ...], frames: int | None = None) -> list[RunMark]:
    """Return a mark for each error reported by a drive, and for each change of a drive's state.

    Drives with the same error or state shortly after another share a mark. `frames` limits the lines of the log that
    count.

    Raises:
        InputError: a line is not in candump's format; the message names file and line.
    """
    marks: list[RunMark] = []
    states: dict[int, str] = {}
    for counts, (cob_id, data) in read_frames(log, frames):
        error, status = cob_id - COB_EMCY - FIRST_NODE_ID, cob_id - COB_TPDO[0] - FIRST_NODE_ID
        if 0 <= error < len(names) and len(data) == 8:
            code = int.from_bytes(data[:2], "little")
            if code:
                _add(marks, MarkKind.ERROR, counts, names[error], error_words(code))
        elif 0 <= status < len(names) and len(data) == _STATUS_BYTES:
            state = _state_words(int.from_bytes(data[:2], "little"))
            if state and states.get(status) != state:
                states[status] = state
                _add(marks, MarkKind.STATE, counts, names[status], state)
    return marks


def _state_words(statusword: int) -> str:
    """Return a drive's state as text; states of the standard with one text are joined; empty for no state."""
    try:
        return state_words(State.of(statusword))
    except ValueError:
        return ""


def _add(marks: list[RunMark], kind: MarkKind, counts: int, who: str, text: str) -> None:
    """Add a drive's error or new state, to an earlier mark if another drive had the same shortly before."""
    for i in range(len(marks) - 1, max(len(marks) - _LOOK_BACK, 0) - 1, -1):
        mark = marks[i]
        together = counts - mark.until_counts <= TOGETHER_COUNTS
        if together and (mark.kind, mark.text) == (kind, text) and who not in mark.who.split(", "):
            marks[i] = RunMark(kind, mark.counts, counts, f"{mark.who}, {who}", text)
            return
    marks.append(RunMark(kind, counts, counts, who, text))


def time_words(mark: RunMark, start_counts: int) -> str:
    """Return a mark's time as text, in the motion's time."""
    first_s, last_s = ((counts - start_counts) / COUNTS_PER_SECOND for counts in (mark.counts, mark.until_counts))
    return f"{first_s:.6f} s" if mark.counts == mark.until_counts else f"{first_s:.6f} to {last_s:.6f} s"
