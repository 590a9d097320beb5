"""The layer setting services of one axis (CiA 305): it is found by its identity and takes its node id from a master.

In the state "waiting" the node answers what finds it; in "configuration" it is asked and set. A fast scan finds nodes
that have no node id (FFh). A node id is in force from the next reset of communication on; a node that had none enters
the bus with it as soon as it is switched to "waiting". "Store" keeps it in the flash page of the axis.

The bit rate is the board's, whose nodes share one CAN controller, so no axis changes it: error 1, "bit timing not
supported".
"""

from collections.abc import Callable
from enum import Enum
from typing import ClassVar, Final

from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import NODE_ID_MAX
from steptwin.protocol.lss import (
    FAST_SCAN_START,
    UNCONFIGURED,
    ConfigureError,
    LssCommand,
    LssRequest,
    decode_request,
    encode_answer,
)

_IDENTITY_PARTS: Final = 4
_U32_BITS: Final = 32
_SELECT: Final = (
    LssCommand.SELECT_VENDOR,
    LssCommand.SELECT_PRODUCT,
    LssCommand.SELECT_REVISION,
    LssCommand.SELECT_SERIAL,
)
_IDENTIFY: Final = (
    LssCommand.IDENTIFY_VENDOR,
    LssCommand.IDENTIFY_PRODUCT,
    LssCommand.IDENTIFY_REVISION_LOW,
    LssCommand.IDENTIFY_REVISION_HIGH,
    LssCommand.IDENTIFY_SERIAL_LOW,
    LssCommand.IDENTIFY_SERIAL_HIGH,
)
_INQUIRE: Final = (
    LssCommand.INQUIRE_VENDOR,
    LssCommand.INQUIRE_PRODUCT,
    LssCommand.INQUIRE_REVISION,
    LssCommand.INQUIRE_SERIAL,
)


class LssState(Enum):
    """What a master does with the node."""

    WAITING = 0
    CONFIGURATION = 1


class LssSlave:
    """The state of one node towards an LSS master."""

    def __init__(self, identity: tuple[int, ...], node_id: int, page: FlashPage, busy: Callable[[], bool]) -> None:
        """Set the services up.

        Args:
            identity: vendor, product, revision and serial number, as 1018h has them.
            node_id: node id of an axis whose page stores none.
            page: keeps the node id.
            busy: true while writing flash would disturb the board.
        """
        self._identity = identity
        self._page = page
        self._busy = busy
        self.state: LssState = LssState.WAITING
        self.pending_id: int = node_id if page.node_id is None else page.node_id
        """The node id from the next reset of communication on."""
        self.active_id: int = self.pending_id
        self._matched: list[int] = []
        """Numbers of the parts that a selection or an identification has matched so far, in order."""
        self._scanned_part = 0
        """The part of the identity that a fast scan is at."""

    def handle(self, data: bytes) -> bytes | None:
        """Obey a request; return the answer, None if there is none."""
        request = decode_request(data)
        if request is None:
            return None
        row = self._obeyed.get(request.command)
        if row is None or self.state not in row[0]:
            return None
        return row[1](self, request)

    @property
    def joins(self) -> bool:
        """True for a node without node id that has got one and now enters the bus with it."""
        waiting = self.state is LssState.WAITING
        return waiting and self.active_id == UNCONFIGURED and self.pending_id != UNCONFIGURED

    def _switch(self, request: LssRequest) -> None:
        if request.byte in (LssState.WAITING.value, LssState.CONFIGURATION.value):
            self.state = LssState(request.byte)
            self._matched = []

    def _select(self, request: LssRequest) -> bytes | None:
        part = _SELECT.index(request.command)
        if not self._match(part, matches=request.number == self._identity[part], parts=_IDENTITY_PARTS):
            return None
        self.state = LssState.CONFIGURATION
        return encode_answer(LssCommand.SELECTED)

    def _identify(self, request: LssRequest) -> bytes | None:
        vendor, product, revision, serial = self._identity
        step = _IDENTIFY.index(request.command)
        within = (
            vendor == request.number,
            product == request.number,
            revision >= request.number,
            revision <= request.number,
            serial >= request.number,
            serial <= request.number,
        )
        complete = self._match(step, matches=within[step], parts=len(within))
        return encode_answer(LssCommand.IDENTIFIED) if complete else None

    def _match(self, part: int, *, matches: bool, parts: int) -> bool:
        """Note whether a part matches; return True once all have, in their order."""
        if part == 0:
            self._matched = []
        if not matches or part != len(self._matched):
            self._matched = []
            return False
        self._matched.append(part)
        return len(self._matched) == parts

    def _identify_unconfigured(self, _request: LssRequest) -> bytes | None:
        return encode_answer(LssCommand.UNCONFIGURED_IDENTIFIED) if self._unconfigured else None

    @property
    def _unconfigured(self) -> bool:
        return self.active_id == self.pending_id == UNCONFIGURED

    def _fast_scan(self, request: LssRequest) -> bytes | None:
        if not self._unconfigured:
            return None
        if request.bit == FAST_SCAN_START:
            self._scanned_part = 0
            return encode_answer(LssCommand.IDENTIFIED)
        part, bit, next_part = request.part, request.bit, request.next_part
        if part != self._scanned_part or bit >= _U32_BITS or next_part >= _IDENTITY_PARTS:
            return None
        if request.number >> bit != self._identity[part] >> bit:
            return None
        self._scanned_part = next_part
        if bit == 0 and next_part < part:
            self.state = LssState.CONFIGURATION
        return encode_answer(LssCommand.IDENTIFIED)

    def _configure_node_id(self, request: LssRequest) -> bytes:
        possible = 1 <= request.byte <= NODE_ID_MAX or request.byte == UNCONFIGURED
        if possible:
            self.pending_id = request.byte
        error = ConfigureError.NONE if possible else ConfigureError.REFUSED
        return encode_answer(request.command, bytes((error,)))

    def _refuse_bit_timing(self, request: LssRequest) -> bytes:
        return encode_answer(request.command, bytes((ConfigureError.REFUSED,)))

    def _store(self, request: LssRequest) -> bytes:
        busy = self._busy()
        if not busy:
            self._page.node_id = self.pending_id
        return encode_answer(request.command, bytes((ConfigureError.STORAGE if busy else ConfigureError.NONE,)))

    def _tell_identity(self, request: LssRequest) -> bytes:
        part = self._identity[_INQUIRE.index(request.command)]
        return encode_answer(request.command, part.to_bytes(4, "little"))

    def _tell_node_id(self, request: LssRequest) -> bytes:
        return encode_answer(request.command, bytes((self.active_id,)))

    _obeyed: ClassVar[dict[LssCommand, tuple[tuple[LssState, ...], Callable[..., bytes | None]]]] = {
        LssCommand.SWITCH_GLOBAL: (tuple(LssState), _switch),
        **dict.fromkeys(_SELECT, ((LssState.WAITING,), _select)),
        **dict.fromkeys(_IDENTIFY, ((LssState.WAITING,), _identify)),
        LssCommand.IDENTIFY_UNCONFIGURED: ((LssState.WAITING,), _identify_unconfigured),
        LssCommand.FAST_SCAN: ((LssState.WAITING,), _fast_scan),
        LssCommand.CONFIGURE_NODE_ID: ((LssState.CONFIGURATION,), _configure_node_id),
        LssCommand.CONFIGURE_BIT_TIMING: ((LssState.CONFIGURATION,), _refuse_bit_timing),
        LssCommand.STORE: ((LssState.CONFIGURATION,), _store),
        **dict.fromkeys(_INQUIRE, ((LssState.CONFIGURATION,), _tell_identity)),
        LssCommand.INQUIRE_NODE_ID: ((LssState.CONFIGURATION,), _tell_node_id),
    }
    """The states in which each request is obeyed, and what obeys it."""
