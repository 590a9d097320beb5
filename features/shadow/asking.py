"""Query the nodes of a running machine by SDO uploads only, at standstill and without commands of a host.

There is no I/O here: frames and times come in, requests go out. Only one request is on the bus at a time, and each is
an expedited upload (CiA 301, section 7.2.4.3.5). A node has one SDO server for all clients, so a request between the
frames of another client's transfer would break that transfer. So the queries wait until no other client or host has
sent the nodes anything for a while, and begin again if one does.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from steptwin.host.client.drive_status import FAULT_STATES, at_rest
from steptwin.host.client.words import error_text, state_text
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError
from steptwin.host.record.recorded_bus import Identifiers, Sender
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, State
from steptwin.protocol.dictionary import FACTORS
from steptwin.protocol.entry import Access, DataType, decode
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    NODE_ID_MAX,
    Frame,
)
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import (
    ABORT,
    SDO_BYTES,
    SPECIFIER,
    UPLOAD,
    expedited_value,
    named_address,
    upload_request,
)
from steptwin.protocol.storage import NO_NAME, checksum, stored_name

_QUIET_S: Final = 0.3
"""Silence towards the nodes before they are queried: longer than a pause within a client's transfer."""
_ANSWER_S: Final = 1.0
_PATIENCE_S: Final = 30.0
"""Longest wait of the queries for a machine that moves, or for other clients."""

RESTS: Final = (
    od.STATUSWORD,
    od.MODE_OF_OPERATION_DISPLAY,
    od.CONTROLWORD,
    od.POSITION_ACTUAL,
    od.VELOCITY_ACTUAL,
    od.BUFFER_POSITION,
    od.ERROR_REGISTER,
    od.ERROR_CODE,
)
"""Values that are read first, and again at the end; all must be equal then."""
_ACTS: Final = frozenset((*od.STORES, *od.RESTORES, od.PVT_SEQUENCE, od.EMERGENCY_STOP))
"""Entries that are no settings: writing one triggers an action."""
_CLOCKS: Final = frozenset((od.TIME_STAMP, od.ERROR_HISTORY_COUNT))
KEPT: Final = tuple(
    address
    for address, entry in ENTRIES.items()
    if entry.access is Access.READ_WRITE
    and entry.data_type is not DataType.VISIBLE_STRING
    and address not in _ACTS | _CLOCKS
)
"""Settings: all numbers that hosts may write."""
_STANDS: Final = (
    od.POSITION_DEMAND,
    od.PVT_NEXT_SEQUENCE,
    od.PVT_FREE_RECORDS,
    od.FAULT_NUMBER,
    od.ROBOT_NAME_CRC,
)

NodeValues = Mapping[int, int]
"""Values of a node's entries, by address."""


class _Question(NamedTuple):
    node_id: int
    address: int

    @property
    def request(self) -> Frame:
        return Frame(COB_SDO_REQUEST + self.node_id, upload_request(self.address))


class Questions:
    """Queries of all nodes of a machine, in order.

    Attributes:
        standing: values of each node, by its id; None until all have answered.
    """

    def __init__(self, robot_name: str, names: Mapping[int, str], tell: Callable[[str], None]) -> None:
        """Start listening.

        Args:
            robot_name: the robot's name.
            names: names of the axes by node id.
            tell: called with each reason, in one line, for which the queries wait.
        """
        self._crc = checksum(stored_name(robot_name))
        self._robot_name = robot_name
        self._names = names
        self._tell = tell
        self._identifiers = Identifiers(list(names))
        self._began_s: float | None = None
        self._quiet_since_s = 0.0
        self._pending: _Question | None = None
        self._void: _Question | None = None
        """Query in progress when all began again; its answer is ignored."""
        self._sent_s = 0.0
        self._left = self._all()
        self._values: dict[int, dict[int, int]] = {node_id: {} for node_id in names}
        self._why: StepTwinError | None = None
        """Last reason for beginning again."""
        self.standing: Mapping[int, NodeValues] | None = None

    def _all(self) -> "deque[_Question]":
        def of(addresses: Iterable[int]) -> list[_Question]:
            return [_Question(node_id, address) for node_id in self._names for address in addresses]

        others = [address for address in (*_STANDS, *KEPT) if address not in RESTS]
        return deque((*of(RESTS), *of(others), *of(RESTS)))

    def hear(self, now_s: float, frame: Frame | None) -> Frame | None:
        """Process the next frame on the bus, None without one; return the request to send now, if any.

        Args:
            now_s: time in s by a clock that is never set.
            frame: the frame.

        Raises:
            DeviceFaultError: an axis has an error.
            BusError: a node does not answer, or other clients have used the nodes all the time.
            InputError: the machine has moved all the time, is another robot's, or has another firmware.
        """
        if self._began_s is None:
            self._began_s = self._quiet_since_s = now_s
        if frame is not None:
            self._take(now_s, frame)
        if self.standing is not None:
            return None
        if self._pending is not None:
            if now_s - self._sent_s < _ANSWER_S:
                return None
            raise BusError(f"{self._at(self._pending.node_id)} does not answer: is it switched on, and not stopped?")
        if now_s - self._quiet_since_s < _QUIET_S:
            return None
        self._pending, self._sent_s = self._left.popleft(), now_s
        return self._pending.request

    def _at(self, node_id: int) -> str:
        return f"{self._names[node_id]}: node 0x{node_id:02X}"

    # --- frames

    def _take(self, now_s: float, frame: Frame) -> None:
        base, node_id = frame.cob_id & ~NODE_ID_MAX, frame.cob_id & NODE_ID_MAX
        asked = self._pending
        if asked is not None and _answers(frame, asked):
            self._pending = None
            self._answer(now_s, asked, frame.data)
            return
        if self._void is not None and _answers(frame, self._void):
            self._void = None
            return
        if asked is not None and frame == asked.request:
            return  # an interface may return its own frames
        sender = self._identifiers.sender_of(frame)
        if sender is Sender.HOST and (base in (*COB_RPDO, COB_SDO_REQUEST) or frame.cob_id == COB_NMT):
            to = self._at(node_id) if node_id in self._names else "the nodes"
            what = "is asked by another client" if base == COB_SDO_REQUEST else "gets commands from a host"
            if to == "the nodes":
                what = "get commands from a host"
            self._put_off(now_s, BusError(f"{to} {what}"))
        elif sender is Sender.BOARD and base == COB_SDO_RESPONSE:
            self._put_off(now_s, BusError(f"{self._at(node_id)} answers another client"))
        elif sender is Sender.BOARD and (base == COB_EMCY or _is_boot_up(frame)):
            what = "reports an error or its end" if base == COB_EMCY else "restarts"
            self._put_off(now_s, BusError(f"{self._at(node_id)} {what}"))

    def _put_off(self, now_s: float, why: StepTwinError) -> None:
        """Begin again once the nodes are idle; raise an error after too long a wait."""
        assert self._began_s is not None
        if now_s - self._began_s > _PATIENCE_S:
            raise why
        self._quiet_since_s, self._left = now_s, self._all()
        self._pending, self._void = None, self._pending
        self._values = {node_id: {} for node_id in self._names}
        if self._why is None or str(why) != str(self._why):
            self._tell(f"{why}: asking again, for up to {_PATIENCE_S:g} s")
        self._why = why

    # --- answers

    def _answer(self, now_s: float, asked: _Question, data: bytes) -> None:
        """Process an answer to a query; check a node when all values that show its standstill are known."""
        entry = ENTRIES[asked.address]
        told = expedited_value(data, UPLOAD)
        if told is None or len(told.data) != entry.data_type.size:
            place = od.place_text(asked.address)
            raise InputError(f"{self._at(asked.node_id)} does not tell {place} as its twin does: {data.hex(' ')}")
        value, values = decode(entry.data_type, told.data), self._values[asked.node_id]
        if values.setdefault(asked.address, value) != value:
            self._put_off(now_s, InputError(f"{self._names[asked.node_id]}: does not stay as it is"))
            return
        if asked.address == RESTS[-1]:
            self._look(now_s, asked.node_id, values)
        if asked.address == od.ROBOT_NAME_CRC and value not in (NO_NAME, self._crc):
            raise InputError(f"{self._at(asked.node_id)} belongs to another robot than {self._robot_name}")
        if asked.address in FACTORS and value != entry.default:
            place = od.place_text(asked.address)
            raise InputError(f"{self._at(asked.node_id)} has user units ({place} is {value}): join by its boot-up")
        if not self._left and self._pending is None:
            self.standing = self._values

    def _look(self, now_s: float, node_id: int, values: NodeValues) -> None:
        """Raise an error for a node with one; wait for one that moves."""
        name, statusword = self._names[node_id], values[od.STATUSWORD]
        try:
            state = State.of(statusword)
        except ValueError:
            raise InputError(f"{name}: its statusword 0x{statusword:04X} tells no state") from None
        if state in FAULT_STATES or values[od.ERROR_REGISTER]:
            error = error_text(values[od.ERROR_CODE]) if values[od.ERROR_CODE] else "an error"
            raise DeviceFaultError(
                f"{name}: {state_text(state)}, {error} (0x{values[od.ERROR_CODE]:04X}), error register"
                f" 0x{values[od.ERROR_REGISTER]:02X}: end it, then join"
            )
        if values[od.CONTROLWORD] & Control.HALT:
            self._put_off(now_s, InputError(f"{name}: is halted, and may have a way to go"))
        elif (
            values[od.VELOCITY_ACTUAL]
            or values[od.BUFFER_POSITION]
            or not at_rest(statusword, values[od.MODE_OF_OPERATION_DISPLAY])
        ):
            self._put_off(now_s, InputError(f"{name}: moves, or has records to execute"))


def _answers(frame: Frame, asked: _Question) -> bool:
    """Return whether a response answers a query, with its value or with an abort."""
    data = frame.data
    of_node = frame.cob_id == COB_SDO_RESPONSE + asked.node_id and len(data) == SDO_BYTES
    return of_node and named_address(data) == asked.address and data[0] & SPECIFIER in (UPLOAD, ABORT)


def _is_boot_up(frame: Frame) -> bool:
    return frame.cob_id & ~NODE_ID_MAX == COB_HEARTBEAT and frame.data == bytes((NmtState.INITIALISING,))
