"""Send and receive process data: mappings, transmission types, inhibit times, event timers (CiA 301, section 7.2.2).

When a transmit PDO is sent depends on its transmission type:

- 0: with the first SYNC after a value has changed; 1 to 240: with every n-th SYNC.
- 254: by its event timer, and when any mapped value changes.
- 255: by its event timer, and when a mapped value of `ANNOUNCED` changes; any value if it maps none of these.

Values outside of `ANNOUNCED`, such as positions, are sampled. A receive PDO of type 0 to 240 acts with the next SYNC.

The values of one frame, or of all receive PDOs that wait for one SYNC, are one process image. They act in the order of
`ImageStage`, regardless of the order of mappings and PDOs. So a target that comes together with a controlword is stored
before the controlword acts.

PDOs are rebuilt from the dictionary whenever one of their parameters changes. Their values are decoded and encoded by
shifting one integer, which is fast for fields of any width. A receive PDO may map data types as dummies: their bits are
skipped.

A receive PDO with an event timer must arrive within that time after each of its frames, while the node is OPERATIONAL
(deadline monitoring, CiA 301, section 7.5.2.35). Monitoring starts with the first frame, and again with the first frame
after a time-out.
"""

from collections.abc import Callable, Iterable
from collections.abc import Set as AbstractSet
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import ObjectDictionary, check_cob_id
from steptwin.protocol.entry import Access, Mapping
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_MASK, COB_ID_NO_RTR, Frame
from steptwin.protocol.objects import ANY_CHANGE, DUMMY_BITS
from steptwin.protocol.od import address_of
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_LAST_SYNCHRONOUS: Final = 240
ANNOUNCED: Final = frozenset(
    (
        od.STATUSWORD,
        od.MODE_OF_OPERATION_DISPLAY,
        od.DIGITAL_INPUTS,
        od.ERROR_CODE,
        od.PVT_FLAGS,
        od.TOUCH_PROBE_STATUS,
    )
)
"""Entries whose changes the firmware reports to `ProcessData.changed`."""
SAMPLE_US: Final = 1000
"""Sampling period of the other entries; a longer inhibit time extends it."""
_INHIBIT_UNIT_US: Final = 100
_MS_US: Final = 1000
_integer: Final = int.from_bytes  # bound once: the lookup costs time for every frame
_NO_ERROR: Final = ErrorCode.NONE  # bound once: access to an enum's member costs time for every frame


_COMMUNICATION: Final = dict(
    zip((*od.RPDO_MAPPING, *od.TPDO_MAPPING), (*od.RPDO_COMMUNICATION, *od.TPDO_COMMUNICATION), strict=True)
)
"""Index of a PDO's communication parameter by the index of its mapping parameter."""
_DUMMIES: Final = frozenset(address_of(index) << 8 | bits for index, bits in DUMMY_BITS.items())
"""Mapping words of the dummies."""


class ImageStage(IntEnum):
    """Stage of a process image in which a value acts."""

    PARAMETER = 0
    """All entries without a stage of their own."""
    RECORD = 1
    """PVT records (60C1h), in the order of their PDOs."""
    MODE = 2
    TARGET = 3
    """Targets act after the mode, so the new mode uses them."""
    CONTROLWORD = 4


_ALL_STAGES: Final = tuple(ImageStage)
_AT_ONCE: Final = (None,)
"""For a single PDO, whose values are already in the order of the stages."""
_STAGES: Final = {
    od.PVT_DISPLACEMENT: ImageStage.RECORD,
    od.PVT_END_VELOCITY: ImageStage.RECORD,
    od.PVT_DURATION_MS: ImageStage.RECORD,
    od.PVT_SEQUENCE: ImageStage.RECORD,
    od.MODE_OF_OPERATION: ImageStage.MODE,
    od.TARGET_POSITION: ImageStage.TARGET,
    od.TARGET_VELOCITY: ImageStage.TARGET,
    od.INTERPOLATION_SET_POINT: ImageStage.TARGET,
    od.CONTROLWORD: ImageStage.CONTROLWORD,
}


class MappedCell(Protocol):
    """Storage of a value that PDOs carry."""

    value: int

    @property
    def plain(self) -> bool:
        """True if a write needs no check and triggers nothing."""
        ...

    def get(self) -> int:
        """Return the present value."""
        ...

    def put(self, value: int) -> None:
        """Check and store a value; raise SdoAbortError if it is refused."""
        ...


class MappedObjects(Protocol):
    """Object dictionary as PDOs use it: their parameters, and the values that they carry."""

    def get(self, address: int) -> int:
        """Return the present value of a numeric entry."""
        ...

    def bus_cell(self, address: int) -> MappedCell:
        """Return the cell of a numeric entry that the bus sees."""
        ...

    def is_signed(self, address: int) -> bool:
        """Return whether a numeric entry has a sign."""
        ...


class PdoParameters(NamedTuple):
    """Indexes of a PDO's communication and mapping parameters."""

    communication: int
    mapping: int


_RECEIVE: Final = tuple(map(PdoParameters, od.RPDO_COMMUNICATION, od.RPDO_MAPPING))
_TRANSMIT: Final = tuple(map(PdoParameters, od.TPDO_COMMUNICATION, od.TPDO_MAPPING))


class _Field(NamedTuple):
    """One mapped entry and its bits in the PDO's integer."""

    address: int
    cell: MappedCell
    shift: int
    mask: int
    sign_bit: int


def _fields(dictionary: MappedObjects, mapping_index: int) -> tuple[list[_Field], int]:
    """Return the fields of a mapping, without dummies, and its length in bytes, rounded up."""
    fields, shift = [], 0
    for subindex in range(1, dictionary.get(address_of(mapping_index)) + 1):
        word = dictionary.get(address_of(mapping_index, subindex))
        address, bits = word >> 8, word & 0xFF
        if address >> 8 not in DUMMY_BITS:
            sign_bit = 1 << bits - 1 if dictionary.is_signed(address) else 0
            fields.append(_Field(address, dictionary.bus_cell(address), shift, (1 << bits) - 1, sign_bit))
        shift += bits
    return fields, -(-shift // 8)


class _Target(NamedTuple):
    """A field of a receive PDO and the cell of its value."""

    field: _Field
    cell: MappedCell
    plain: bool


def _by_stage(fields: list[_Field]) -> list[list[_Target]]:
    """Return the fields of a receive PDO by their stages; a record's sequence number, which queues it, comes last.

    If another PDO carries the sequence number, the record's fields are parameters: they must be stored before it.
    """
    has_number = any(field.address == od.PVT_SEQUENCE for field in fields)
    targets: list[list[_Target]] = [[] for _ in ImageStage]
    for field in sorted(fields, key=lambda each: each.address == od.PVT_SEQUENCE):
        stage = _STAGES.get(field.address, ImageStage.PARAMETER)
        if stage is ImageStage.RECORD and not has_number:
            stage = ImageStage.PARAMETER
        targets[stage].append(_Target(field, field.cell, field.cell.plain))
    return targets


class ReceivePdo:
    """One receive PDO."""

    def __init__(self, dictionary: MappedObjects, parameters: PdoParameters, on_refused: Callable[[int], None]) -> None:
        """Read the parameters.

        Args:
            dictionary: holds the parameters and the values.
            parameters: their indexes.
            on_refused: called with the mapping word of each refused value.
        """
        communication = parameters.communication
        self.cob_id: int = dictionary.get(address_of(communication, od.PDO_COB_ID))
        self.exists: bool = not self.cob_id & COB_ID_INVALID
        """True if its COB-ID is valid."""
        self.synchronous: bool = (
            dictionary.get(address_of(communication, od.PDO_TRANSMISSION_TYPE)) <= _LAST_SYNCHRONOUS
        )
        self.timeout_us: int = dictionary.get(address_of(communication, od.PDO_EVENT_TIMER)) * _MS_US
        """Longest time between two frames; 0 for no limit."""
        self.deadline_us: int | None = None
        """Instant when the next frame is late; None while none is awaited."""
        fields, self._length = _fields(dictionary, parameters.mapping)
        self._by_stage = _by_stage(fields)
        self._in_order = [target for targets in self._by_stage for target in targets]
        self._latched: bytes | None = None
        self._on_refused = on_refused

    def receive(self, data: bytes) -> ErrorCode:
        """Let a frame act now, or latch it for the next SYNC; return the error of its length, or NONE."""
        excess = len(data) - self._length
        if excess < 0:
            return ErrorCode.PDO_TOO_SHORT
        if self.synchronous:
            self._latched = data
        else:
            self.act(data)
        return ErrorCode.PDO_TOO_LONG if excess else _NO_ERROR

    def timed_out(self, now_us: int) -> bool:
        """Return True, once, when the next frame is late."""
        if self.deadline_us is None or now_us < self.deadline_us:
            return False
        self.deadline_us = None
        return True

    def take_latched(self) -> bytes | None:
        """Return and forget the latched frame; None if there is none."""
        data, self._latched = self._latched, None
        return data

    def act(self, data: bytes, stage: ImageStage | None = None) -> None:
        """Let the values of a frame act: all in the order of their stages, or those of one stage."""
        targets = self._in_order if stage is None else self._by_stage[stage]
        bits = _integer(data[: self._length], "little")
        for field, cell, plain in targets:
            value = ((bits >> field.shift & field.mask) ^ field.sign_bit) - field.sign_bit
            if plain:  # as most values are: the fields of a PVT record but the last
                cell.value = value
                continue
            try:
                cell.put(value)
            except SdoAbortError:
                self._on_refused(field.address << 8 | field.mask.bit_length())


def act_on_sync(pdos: Iterable[ReceivePdo]) -> None:
    """Let all latched frames act as one process image."""
    latched = [(pdo, data) for pdo in pdos if (data := pdo.take_latched()) is not None]
    for stage in _ALL_STAGES if len(latched) > 1 else _AT_ONCE:
        for pdo, data in latched:
            pdo.act(data, stage)


class TransmitPdo:
    """One transmit PDO with its timers."""

    def __init__(
        self,
        dictionary: MappedObjects,
        parameters: PdoParameters,
        now_us: int,
        sync_counter_overflow: int,
        announced: AbstractSet[int] | None = ANNOUNCED,
    ) -> None:
        """Read the parameters.

        Args:
            dictionary: holds the parameters and the values.
            parameters: their indexes.
            now_us: present time.
            sync_counter_overflow: value of 1019h; 0 if SYNC carries no counter.
            announced: entries whose changes are reported by `trigger`, which type 255 relies on; None if the changes of
                all entries are, for any type.
        """
        communication = parameters.communication
        self.cob_id: int = dictionary.get(address_of(communication, od.PDO_COB_ID))
        self.exists: bool = not self.cob_id & COB_ID_INVALID
        """True if its COB-ID is valid."""
        self.transmission_type: int = dictionary.get(address_of(communication, od.PDO_TRANSMISSION_TYPE))
        self._inhibit_us = dictionary.get(address_of(communication, od.PDO_INHIBIT_TIME)) * _INHIBIT_UNIT_US
        self._event_timer_us = dictionary.get(address_of(communication, od.PDO_EVENT_TIMER)) * _MS_US
        fields, self._length = _fields(dictionary, parameters.mapping)
        self._fields = fields
        self.addresses: frozenset[int] = frozenset(field.address for field in fields)
        self.event_driven: bool = self.transmission_type >= ANY_CHANGE
        """True if the PDO is sent when a mapped value changes."""
        triggered = announced is None or (self.transmission_type > ANY_CHANGE and bool(self.addresses & announced))
        self._sampled = self.event_driven and bool(fields) and not triggered
        self._sample_due_us = now_us
        self._wanted = False
        self._sent: bytes | None = None
        self._syncs = 0
        self._awaited_counter = (
            dictionary.get(address_of(communication, od.PDO_SYNC_START)) if sync_counter_overflow else 0
        )
        self._not_before_us = now_us
        self._timer_us = now_us + self._event_timer_us

    def trigger(self) -> None:
        """Request a transmission, because a mapped value has changed; the inhibit time may delay it."""
        self._wanted = True

    def on_sync(self, counter: int = 0) -> Frame | None:
        """Count a SYNC; return the frame if the transmission type requires one now.

        With a SYNC start value, counting starts at the SYNC with this counter (CiA 301, section 7.5.2.37).
        """
        if self.transmission_type > _LAST_SYNCHRONOUS or self._awaited_counter not in (0, counter):
            return None
        self._awaited_counter = 0
        self._syncs += 1
        if self._syncs < self.transmission_type:
            return None
        self._syncs = 0
        frame = self._frame()
        if self.transmission_type == 0 and not self._wanted and frame.data == self._sent:
            return None
        self._wanted = False
        self._sent = frame.data
        return frame

    @property
    def due_us(self) -> int | None:
        """Next instant when `poll` has work; None if only an event or a SYNC can trigger it."""
        if not self.event_driven:
            return None
        if self._wanted:
            return self._not_before_us
        due_us = self._timer_us if self._event_timer_us else None
        if self._sampled and (due_us is None or self._sample_due_us < due_us):
            due_us = self._sample_due_us
        return None if due_us is None else max(due_us, self._not_before_us)

    def poll(self, now_us: int) -> Frame | None:
        """Return the frame if it is due; None if it is not, or if a sample shows no change."""
        due_us = self.due_us
        if due_us is None or now_us < due_us:
            return None
        frame = self._frame()
        if self._sampled:
            self._sample_due_us = now_us + SAMPLE_US
            timed_out = self._event_timer_us and self._timer_us <= now_us
            if not (self._wanted or timed_out) and frame.data == self._sent:
                return None
            self._sent = frame.data
        self._wanted = False
        self._not_before_us = now_us + self._inhibit_us
        self._timer_us = now_us + self._event_timer_us
        return frame

    def _frame(self) -> Frame:
        bits = 0
        for field in self._fields:
            bits |= (field.cell.get() & field.mask) << field.shift
        return Frame(self.cob_id & COB_ID_MASK, bits.to_bytes(self._length, "little"))


class ProcessData:
    """All PDOs of a node. `refresh` rebuilds them after a change of their parameters."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self.receive_pdos: list[ReceivePdo] = []
        self.transmit_pdos: list[TransmitPdo] = []
        dictionary.bind(self)
        self.configurable = True
        """True in PRE-OPERATIONAL, the only state in which PDO parameters may be written."""
        self._changed = True

    def refresh(self, now_us: int) -> bool:
        """Rebuild the PDOs if their parameters have changed; return whether they have."""
        if not self._changed:
            return False
        self._changed = False
        overflow = self._dictionary.get(od.SYNC_COUNTER_OVERFLOW)
        self.receive_pdos = [ReceivePdo(self._dictionary, each, self._note_refused) for each in _RECEIVE]
        self.transmit_pdos = [TransmitPdo(self._dictionary, each, now_us, overflow) for each in _TRANSMIT]
        return True

    def _note_refused(self, word: int) -> None:
        """Count a refused value of an RPDO and store its mapping word (2014h:03 and :04)."""
        self._dictionary.cell(od.RPDO_VALUES_REFUSED).count()
        self._dictionary.set(od.RPDO_LAST_REFUSED, word)

    def invalidate(self) -> None:
        """Make the next `refresh` rebuild the PDOs, because of reset parameters or to restart their timers."""
        self._changed = True

    def changed(self, address: int) -> None:
        """Trigger the transmit PDOs that map an entry whose value has changed."""
        for pdo in self.transmit_pdos:
            if address in pdo.addresses:
                pdo.trigger()

    def sync_counter(self, data: bytes) -> int | None:
        """Return the counter of a SYNC frame; 0 if SYNC carries none, None if the frame's length is wrong.

        SYNC carries a counter if the synchronous counter overflow value (1019h) is not 0 (CiA 301, section 7.2.5).
        """
        counted = self._dictionary.get(od.SYNC_COUNTER_OVERFLOW) != 0
        if len(data) != counted:
            return None
        return data[0] if counted else 0

    def check_sync_overflow(self, value: int) -> None:
        """Refuse the value 1, and any change while a cycle period (1006h) is set (CiA 301, section 7.5.2.19).

        The object table already bounds the value to 0..240. The cycle period concerns SYNC producers; here it is only
        stored.
        """
        if value == 1:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if self._dictionary.get(od.COMMUNICATION_CYCLE_PERIOD):
            raise SdoAbortError(AbortCode.DEVICE_STATE)

    def check_configurable(self, _value: int) -> None:
        """Refuse a change outside of PRE-OPERATIONAL; an allowed change rebuilds the PDOs."""
        if not self.configurable:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self._changed = True

    def check_cob_id_at(self, address: int, value: int) -> None:
        """Refuse a COB-ID that no PDO may have, and a new identifier for a valid PDO."""
        self.check_configurable(value)
        check_cob_id(self._dictionary.get(address), value, COB_ID_NO_RTR)

    def check_transmission_type(self, value: int) -> None:
        """Refuse types 241 to 251 (reserved), and 252 and 253 (they need remote frames)."""
        self.check_configurable(value)
        if _LAST_SYNCHRONOUS < value < ANY_CHANGE:
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    def check_while_invalid_at(self, address: int, value: int) -> None:
        """Refuse a change of mapping, inhibit time or SYNC start value while the PDO is valid."""
        self.check_configurable(value)
        communication = _COMMUNICATION.get(address >> 8, address >> 8)
        if not self._dictionary.get(address_of(communication, od.PDO_COB_ID)) & COB_ID_INVALID:
            raise SdoAbortError(AbortCode.DEVICE_STATE)

    def check_count_at(self, address: int, count: int) -> None:
        """Refuse a number of mapped entries if one of them is missing, or if together they exceed 8 bytes."""
        self.check_while_invalid_at(address, count)
        words = [self._dictionary.get(address + i) for i in range(1, count + 1)]
        if 0 in words:
            raise SdoAbortError(AbortCode.CANNOT_BE_MAPPED)
        if sum(word & 0xFF for word in words) > 64:
            raise SdoAbortError(AbortCode.PDO_TOO_LONG)

    def check_mapped_at(self, address: int, word: int) -> None:
        """Refuse an entry that this kind of PDO cannot map, and any change while the number of entries is not 0."""
        self.check_while_invalid_at(address, word)
        if self._dictionary.get(address_of(address >> 8)):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        entry = self._dictionary.entries.get(word >> 8)
        kind = Mapping.RECEIVE if address >> 8 in od.RPDO_MAPPING else Mapping.TRANSMIT
        if kind is Mapping.RECEIVE and word in _DUMMIES:
            return
        if word == 0:
            return
        if entry is None or entry.access is Access.CONST or word & 0xFF != 8 * entry.data_type.size:
            raise SdoAbortError(AbortCode.CANNOT_BE_MAPPED)
        if not entry.mapping.value & kind.value:
            raise SdoAbortError(AbortCode.CANNOT_BE_MAPPED)
