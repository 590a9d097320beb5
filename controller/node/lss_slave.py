"""The layer setting services of one axis (CiA 305): a master finds the node and sets its node id and bit rate.

In the state "waiting" the node answers identification requests; in "configuration" a master reads and sets it. A fast
scan finds nodes without node id (FFh). A new node id is valid from the next reset of communication on; a node that had
none uses it as soon as it is switched to "waiting". "Store" saves it in the flash page of the axis.

All axes of a board share one CAN controller. So a bit rate that a master configures or stores at one axis is valid for
all.
"""

from collections.abc import Callable, Sequence
from enum import Enum
from typing import ClassVar, Final

from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import NODE_ID_MAX
from steptwin.protocol.lss import (
    BIT_TIMINGS,
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
_US_PER_MS: Final = 1000
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
    """LSS state of the node."""

    WAITING = 0
    CONFIGURATION = 1


class BitTiming:
    """The bit rate of a board's CAN controller.

    "Activate" silences the controller for a delay, then changes its rate, and lets it send after another such delay. In
    this time the other stations of the bus change their rates, too.
    """

    def __init__(self, pages: Sequence[FlashPage]) -> None:
        """Power up with the flash pages of all axes, which store the rate."""
        self._pages = pages
        self.bitrate: int | None = pages[0].bitrate
        """Bit rate of the controller, in bit/s; None for the default of the board."""
        self.silent: bool = False
        """True while the controller must be off the bus."""
        self.due_us: int | None = None
        """Time of the next call of `poll`; None if no change is in progress."""
        self.on_change: Callable[[], None] = lambda: None
        """Called when `bitrate` or `silent` has changed."""
        self._configured = self.bitrate
        self._delay_us = 0
        self._changed = False
        """True after the change of the rate, until the controller may send again."""

    def configure(self, bitrate: int) -> None:
        """Set the rate that the next `activate` or `store` uses."""
        self._configured = bitrate

    def store(self) -> None:
        """Store the configured rate in the flash pages of all axes, for the next power-up."""
        for page in self._pages:
            page.bitrate = self._configured

    def activate(self, delay_us: int, now_us: int) -> None:
        """Begin to change the rate, unless a change is already in progress."""
        if self.due_us is None:
            self.silent, self._changed = True, False
            self._delay_us, self.due_us = delay_us, now_us + delay_us
            self.on_change()

    def poll(self, now_us: int) -> None:
        """Change the rate, or let the controller send again, if that is due."""
        if self.due_us is None or now_us < self.due_us:
            return
        if self._changed:
            self.silent, self.due_us = False, None
        else:
            self.bitrate, self._changed = self._configured, True
            self.due_us += self._delay_us
        self.on_change()


class LssSlave:
    """The LSS side of one node."""

    def __init__(
        self,
        identity: tuple[int, ...],
        node_id: int,
        page: FlashPage,
        timing: BitTiming,
        busy: Callable[[], bool],
    ) -> None:
        """Power up.

        Args:
            identity: vendor, product, revision and serial number (1018h).
            node_id: default node id, if the page stores none.
            page: stores the node id.
            timing: bit rate of the board.
            busy: returns true while a flash write would disturb the motion.
        """
        self._identity = identity
        self._page = page
        self._timing = timing
        self._now_us = 0
        """Time of the present request."""
        self._busy = busy
        self.state: LssState = LssState.WAITING
        self.pending_id: int = node_id if page.node_id is None else page.node_id
        """Node id from the next reset of communication on."""
        self.active_id: int = self.pending_id
        self._matched: list[int] = []
        """Numbers of the parts that have matched in a selection or identification, in order."""
        self._scanned_part = 0
        """Part of the identity that a fast scan compares next."""

    def handle(self, data: bytes, now_us: int) -> bytes | None:
        """Obey a request; return its answer, or None."""
        self._now_us = now_us
        request = decode_request(data)
        if request is None:
            return None
        row = self._obeyed.get(request.command)
        if row is None or self.state not in row[0]:
            return None
        return row[1](self, request)

    @property
    def joins(self) -> bool:
        """True if a node without node id has got one and must now start to use it."""
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
        """Record whether a part matches; return True when all parts have matched in order."""
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

    def _configure_bit_timing(self, request: LssRequest) -> bytes:
        """Configure a rate of table 0, the bit timing table of CiA 305."""
        bitrate = BIT_TIMINGS.get(request.second_byte) if request.byte == 0 else None
        if bitrate is None:
            return encode_answer(request.command, bytes((ConfigureError.REFUSED,)))
        self._timing.configure(bitrate)
        return encode_answer(request.command, bytes((ConfigureError.NONE,)))

    def _activate_bit_timing(self, request: LssRequest) -> None:
        self._timing.activate(request.word * _US_PER_MS, self._now_us)

    def _store(self, request: LssRequest) -> bytes:
        busy = self._busy()
        if not busy:
            self._page.node_id = self.pending_id
            self._timing.store()
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
        LssCommand.CONFIGURE_BIT_TIMING: ((LssState.CONFIGURATION,), _configure_bit_timing),
        LssCommand.ACTIVATE_BIT_TIMING: ((LssState.CONFIGURATION,), _activate_bit_timing),
        LssCommand.STORE: ((LssState.CONFIGURATION,), _store),
        **dict.fromkeys(_INQUIRE, ((LssState.CONFIGURATION,), _tell_identity)),
        LssCommand.INQUIRE_NODE_ID: ((LssState.CONFIGURATION,), _tell_node_id),
    }
    """For each command, the states in which it is obeyed, and its handler."""
