"""Compare the frames of a recorded bus, and the edges of its run, with those of the replay.

On the board's clock every frame must be the same at the same microsecond. By a computer's clock the board's frames come
a little earlier or later among the hosts'. Then each node must send the same messages to its hosts: answers to
requests, errors, boot-ups, drive states, and the position where it comes to rest. Positions and other measured values
during a motion depend on the instant; the edges judge them.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import zip_longest
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.host.client.monitor import Decoded, Decoder
from steptwin.host.common.arrays import Int64Array
from steptwin.host.record.folder.edges_file import angle_column, edge_arrays
from steptwin.host.record.recorded_bus import RecordedFrame
from steptwin.host.verify import AxisEvidence, Evidence
from steptwin.protocol.cia402 import State
from steptwin.protocol.entry import Access, Mapping
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_SDO_RESPONSE,
    COB_TPDO,
    NODE_ID_MAX,
    Frame,
)
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import OBJECT, UPLOAD, expedited_value
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND, COUNTS_PER_US


class Difference(NamedTuple):
    """First difference between a replay and its recording.

    Attributes:
        counts: instant in the recording, or in the replay if the recording has nothing there. It counts from power-up,
            or from the first frame by a computer's clock; None for a step by a computer's clock.
        where: frames or signal that differ, as text.
        recorded: content of the recording there.
        replayed: content of the replay there.
    """

    counts: int | None
    where: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        at = "" if self.counts is None else f"at {instant(self.counts)}, "
        return f"{at}{self.where}: recorded {self.recorded}, replayed {self.replayed}"

    def to_dict(self) -> dict[str, Any]:
        """Return the difference under the keys of the JSON document."""
        at_s = None if self.counts is None else self.counts / COUNTS_PER_SECOND
        return {"at_s": at_s, "where": self.where, "recorded": self.recorded, "replayed": self.replayed}


NOTHING = "nothing"


def instant(counts: int) -> str:
    """Return an instant as text, to the microsecond."""
    return f"{counts / COUNTS_PER_SECOND:.6f} s"


_STATUS: Final = COB_TPDO[0]
"""Status PDO: it begins with the statusword and is sent at each change."""
_CODE_BYTES: Final = 3
"""Error code and error register of an EMCY; the detail after them may be a time."""
_AT_REST: Final = 2
"""Number of equal status PDOs at the end of a recording that show an axis at standstill; they come every 100 ms."""
_SETTLING_COUNTS: Final = 100 * COUNTS_PER_MS
"""Duration before the end of a recording whose messages it may lack."""
_PASSING_COUNTS: Final = 20 * COUNTS_PER_MS
"""Duration below which a state counts as passed, not reached."""


def first_difference_on_the_board_clock(
    recorded: Sequence[RecordedFrame], replayed: Sequence[tuple[int, Frame]], decoder: Decoder
) -> Difference | None:
    """Return the first frame that differs in content, order or instant; None if all are the same."""
    for old, new in zip_longest(recorded, replayed):
        old_counts = None if old is None else old.us * COUNTS_PER_US
        new_counts = None if new is None else new[0] - new[0] % COUNTS_PER_US
        if old is None or new is None or old.frame != new[1] or old_counts != new_counts:
            counts = min(counts for counts in (old_counts, new_counts) if counts is not None)
            old_text = NOTHING if old is None else _text(old.frame, old_counts, counts, decoder)
            new_text = NOTHING if new is None else _text(new[1], new_counts, counts, decoder)
            return Difference(counts, "on the bus", old_text, new_text)
    return None


def _text(frame: Frame, counts: int | None, first_counts: int, decoder: Decoder) -> str:
    later = f" at {instant(counts)}" if counts is not None and counts != first_counts else ""
    return words_of(frame, decoder) + later


def words_of(frame: Frame, decoder: Decoder) -> str:
    """Return a frame as text: service, node and content."""
    decoded: Decoded = decoder.decode(frame.cob_id, frame.data)
    return " ".join(word for word in (decoded.title, decoded.node, decoded.text) if word and word != "-")


class _NodeMessage(NamedTuple):
    """A node's message: its instant, the content to compare, and its frame."""

    counts: int
    key: bytes | str
    frame: Frame


def first_difference_by_wall_clock(
    recorded: Sequence[tuple[int, Frame]],
    replayed: Sequence[tuple[int, Frame]],
    node_ids: Collection[int],
    decoder: Decoder,
) -> Difference | None:
    """Return the first message that differs, in the order of the nodes; None if all are the same.

    The replay may last longer than the recording: messages at its very end, or later, are not compared.

    Args:
        recorded: the board's frames from the first frame of a host on, with instants since the recording's first frame.
        replayed: the board's frames of the replay, with instants since it began to play.
        node_ids: the board's nodes.
        decoder: returns frames as text.
    """
    old, new = _messages_by_id(recorded), _messages_by_id(replayed)
    settled_counts = recorded[-1][0] - _SETTLING_COUNTS if recorded else 0
    for service, what in SERVICES.items():
        for node_id in sorted(node_ids):
            found = _first(old[service + node_id], new[service + node_id], settled_counts)
            if found:
                counts = next(said.counts for said in found if said is not None)
                texts = (NOTHING if said is None else words_of(said.frame, decoder) for said in found)
                return Difference(counts, what, *texts)
    return _other_end(recorded, replayed, node_ids, decoder)


def _messages_by_id(frames: Iterable[tuple[int, Frame]]) -> dict[int, list[_NodeMessage]]:
    """Return each node's messages by identifier."""
    said: dict[int, list[_NodeMessage]] = defaultdict(list)
    for counts, frame in frames:
        key_of = KEYS.get(frame.cob_id & ~NODE_ID_MAX)
        key = key_of(frame.data) if key_of else None
        if key is None:
            continue
        before = said[frame.cob_id]
        if key_of is state_name:
            _add_state(before, _NodeMessage(counts, key, frame))
        else:
            before.append(_NodeMessage(counts, key, frame))
    return said


def _add_state(states: list[_NodeMessage], state: _NodeMessage) -> None:
    """Add a state that a drive has reached; it replaces a state that the drive has only passed.

    The status PDO has an inhibit time: milliseconds decide whether it shows a short state.
    """
    if states and states[-1].key == state.key:
        return
    if states and state.counts - states[-1].counts < _PASSING_COUNTS:
        states.pop()
    if not states or states[-1].key != state.key:
        states.append(state)


def _first(
    old: Sequence[_NodeMessage], new: Sequence[_NodeMessage], settled_counts: int
) -> tuple[_NodeMessage | None, _NodeMessage | None] | None:
    for was, now in zip_longest(old, new):
        if was is None:
            return (None, now) if now.counts < settled_counts else None
        if now is None or was.key != now.key:
            return was, now
    return None


def _other_end(
    recorded: Sequence[tuple[int, Frame]],
    replayed: Sequence[tuple[int, Frame]],
    node_ids: Collection[int],
    decoder: Decoder,
) -> Difference | None:
    """Return the first node that stops elsewhere, if the recording shows it at standstill."""
    for node_id in sorted(node_ids):
        old = [each for each in recorded if each[1].cob_id == _STATUS + node_id][-_AT_REST:]
        if len(old) < _AT_REST or old[0][1] != old[1][1]:
            continue
        last_counts, last = old[-1]
        end_counts = recorded[-1][0] + _SETTLING_COUNTS
        new = [frame for counts, frame in replayed if frame.cob_id == _STATUS + node_id and counts <= end_counts]
        if new and new[-1] != last:
            return Difference(last_counts, "at the end", words_of(last, decoder), words_of(new[-1], decoder))
    return None


def _answer(data: bytes) -> bytes:
    """Return an SDO response without values of measured objects."""
    told = expedited_value(data, UPLOAD)
    if told is not None:
        entry = ENTRIES.get(told.address)
        if entry and entry.access is Access.READ_ONLY and entry.mapping in (Mapping.TRANSMIT, Mapping.BOTH):
            return data[: OBJECT.stop]
    return data


def _boot_up(data: bytes) -> bytes | None:
    return data if data == bytes((NmtState.INITIALISING,)) else None


def _error(data: bytes) -> bytes:
    return data[:_CODE_BYTES]


def state_name(data: bytes) -> str | None:
    try:
        return State.of(int.from_bytes(data[:2], "little")).name
    except ValueError:
        return None


KEYS: Final[dict[int, Callable[[bytes], bytes | str | None]]] = {
    COB_SDO_RESPONSE: _answer,
    COB_EMCY: _error,
    COB_HEARTBEAT: _boot_up,
    _STATUS: state_name,
}
"""Function for each service that returns the content to compare; None: frame not compared."""
SERVICES: Final = {
    COB_HEARTBEAT: "boot-ups",
    COB_SDO_RESPONSE: "answers",
    _STATUS: "states of the drive",
    COB_EMCY: "errors",
}
"""Compared services in order, with the name of their messages."""


class _EdgeSignal(NamedTuple):
    """Edges of one signal: name, key of their instants, and keys of their values."""

    words: str
    counts: str
    values: tuple[str, ...] = ()


_SIGNALS: Final = (
    _EdgeSignal("STEP rises", "clk_rise_counts"),
    _EdgeSignal("STEP falls", "clk_fall_counts"),
    _EdgeSignal("DIR", "dir_edge_counts", ("dir_levels",)),
    _EdgeSignal("step of the driver", "step_counts", ("step_signs",)),
    _EdgeSignal("broken limit", "violation_counts", ("violation_which", "violation_values")),
    _EdgeSignal("slip of the motor", "slip_counts", ("slip_full_steps",)),
)

_NONE: Final = np.empty(0)
"""Replaces an array that only some axes have."""


def first_difference_of_edges(recorded: Evidence, replayed: Evidence) -> Difference | None:
    """Return the first difference in an edge of a pin, a count or a current of a driver; None if there is none."""
    found = [
        difference
        for old, new in zip(recorded.axes, replayed.axes, strict=True)
        for difference in _differences(old, new)
    ]
    return min(found, key=lambda difference: difference.counts or 0, default=None)


def _differences(old: AxisEvidence, new: AxisEvidence) -> Iterator[Difference]:
    """Yield the first difference of each signal of an axis."""
    old_arrays, new_arrays = edge_arrays(old), edge_arrays(new)
    angles = angle_column(old.phases.per_full_step)
    currents = _EdgeSignal("phase currents", "phase_counts", (angles, "phase_a_ma", "phase_b_ma"))
    pins = (_EdgeSignal(pin.upper(), f"{pin}_counts", (f"{pin}_levels",)) for pin in old.pins)
    for signal in (*_SIGNALS, currents, *pins):
        keys = [f"{old.name}_{key}" for key in (signal.counts, *signal.values)]
        was_arrays, now_arrays = ([arrays.get(key, _NONE) for key in keys] for arrays in (old_arrays, new_arrays))
        if all(map(np.array_equal, was_arrays, now_arrays)):
            continue
        rows = (zip(*(each.tolist() for each in arrays), strict=True) for arrays in (was_arrays, now_arrays))
        for was, now in zip_longest(*rows):
            if was != now:
                counts = min(row[0] for row in (was, now) if row is not None)
                yield Difference(counts, f"{old.name} {signal.words}", _words(was), _words(now))
                break


def _words(row: tuple[float, ...] | None) -> str:
    if row is None:
        return NOTHING
    counts, *values = row
    to = f" to {', '.join(f'{value:g}' for value in values)}" if values else ""
    return f"at {instant(int(counts))} ({int(counts)} counts){to}"


def first_difference_of_steps(recorded: Evidence, replayed: Evidence) -> Difference | None:
    """Return the first step of an axis with another direction or without a counterpart; None if there is none.

    Instants are not compared: by a computer's clock, the hosts' frames are not exact within a servo tick.
    """
    for old, new in zip(recorded.axes, replayed.axes, strict=True):
        for number, (was, now) in enumerate(zip_longest(_signs(old), _signs(new)), start=1):
            if was != now:
                where = f"{old.name}, step {number} of its driver"
                return Difference(None, where, _step(was, old.step_counts, number), _step(now, new.step_counts, number))
    return None


def _signs(axis: AxisEvidence) -> list[int]:
    signs: list[int] = axis.step_signs.tolist()
    return signs


def _step(sign: int | None, counts: Int64Array, number: int) -> str:
    if sign is None:
        return NOTHING
    return f"{sign:+d} at {instant(int(counts[number - 1]))} since power-up"


def greatest_shift_us(recorded: Evidence, replayed: Evidence) -> float:
    """Return the largest difference between instants of equal steps, counted from the last motion's start."""
    shifts_counts = [
        np.abs((new.step_counts - replayed.start_counts) - (old.step_counts - recorded.start_counts))[
            old.step_counts >= recorded.start_counts
        ].max(initial=0)
        for old, new in zip(recorded.axes, replayed.axes, strict=True)
    ]
    return 1e6 * float(max(shifts_counts)) / COUNTS_PER_SECOND
