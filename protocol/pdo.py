"""Send and receive process data: mappings, transmission types, inhibit times, event timers (CiA 301, section 7.2.2).

A transmit PDO of type 1 to 240 is sent with every n-th SYNC, one of type 0 with the first SYNC after its values have
changed, one of type 254 or 255 by its event timer and when a value changes: of type 254 any mapped value, of type 255
one whose changes the drive announces (`ANNOUNCED`) or, if none of these is mapped, any. Values whose changes are not
announced, such as positions, are sampled. A receive PDO of type 0 to 240 takes effect with the next SYNC.

The values that take effect together, those of one frame or of all receive PDOs that wait for one SYNC, are one process
image: they act in the order of `ImageStage`, whatever the order of mappings and PDOs. So a target that comes together
with the controlword is in place when the controlword acts on it.

PDOs are rebuilt from the dictionary's communication and mapping entries whenever one of these changes. Their values are
decoded and encoded by shifting one integer, so a mapping of any widths costs the same few operations. A receive PDO may
map data types as dummies: their bits are skipped.

A receive PDO with an event timer is expected within that time from each of its frames on, while the node is OPERATIONAL
(deadline monitoring, CiA 301, section 7.5.2.35). Monitoring begins with the first frame, and again after a time-out.
"""

from collections.abc import Callable, Iterable
from collections.abc import Set as AbstractSet
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import ObjectDictionary, check_cob_id
from steptwin.protocol.entry import Access, Entry, Mapping
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
"""Entries whose changes the firmware tells `ProcessData.changed`."""
SAMPLE_US: Final = 1000
"""Time between two looks at values whose changes are not announced; the inhibit time may make it longer."""
_INHIBIT_UNIT_US: Final = 100
_MS_US: Final = 1000
_integer: Final = int.from_bytes  # to look it up costs time, for every frame
_NO_ERROR: Final = ErrorCode.NONE  # to fetch a member from its enum costs time, and this is returned for every frame


_COMMUNICATION: Final = dict(
    zip((*od.RPDO_MAPPING, *od.TPDO_MAPPING), (*od.RPDO_COMMUNICATION, *od.TPDO_COMMUNICATION), strict=True)
)
"""Index of a PDO's communication parameter, by that of its mapping."""
_DUMMIES: Final = frozenset(address_of(index) << 8 | bits for index, bits in DUMMY_BITS.items())
"""The dummies as a mapping names them."""


class ImageStage(IntEnum):
    """When a value acts within a process image."""

    PARAMETER = 0
    """All entries that are named nowhere else."""
    RECORD = 1
    """The PVT records (60C1h), in the order of the PDOs that bring them."""
    MODE = 2
    TARGET = 3
    """After the mode: so they count in the mode that comes with them."""
    CONTROLWORD = 4


_ALL_STAGES: Final = tuple(ImageStage)
_AT_ONCE: Final = (None,)
"""The stages of a single PDO: its own order is that of the stages."""
_STAGES: Final = {
    od.PVT_DISPLACEMENT: ImageStage.RECORD,
    od.PVT_END_VELOCITY: ImageStage.RECORD,
    od.PVT_DURATION_MS: ImageStage.RECORD,
    od.PVT_SEQUENCE: ImageStage.RECORD,
    od.MODE_OF_OPERATION: ImageStage.MODE,
    od.TARGET_POSITION: ImageStage.TARGET,
    od.TARGET_VELOCITY: ImageStage.TARGET,
    od.CONTROLWORD: ImageStage.CONTROLWORD,
}


class MappedCell(Protocol):
    """The place of a value that PDOs carry."""

    value: int

    @property
    def plain(self) -> bool:
        """True if storing any value of its width is all."""
        ...

    def get(self) -> int:
        """Return the present value."""
        ...

    def put(self, value: int) -> None:
        """Store a value after its checks; raise SdoAbortError if it is refused."""
        ...


class MappedObjects(Protocol):
    """An object dictionary as PDOs see it: their parameters, and the values that they carry."""

    def get(self, address: int) -> int:
        """Return the present value of a numeric entry."""
        ...

    def cell(self, address: int) -> MappedCell:
        """Return the place of a numeric entry."""
        ...

    def is_signed(self, address: int) -> bool:
        """Return whether a numeric entry has a sign."""
        ...


class PdoParameters(NamedTuple):
    """The indexes of a PDO's parameters."""

    communication: int
    mapping: int


_RECEIVE: Final = tuple(map(PdoParameters, od.RPDO_COMMUNICATION, od.RPDO_MAPPING))
_TRANSMIT: Final = tuple(map(PdoParameters, od.TPDO_COMMUNICATION, od.TPDO_MAPPING))


class _Field(NamedTuple):
    """One mapped entry and its place in the PDO's integer."""

    address: int
    cell: MappedCell
    shift: int
    mask: int
    sign_bit: int


def _fields(dictionary: MappedObjects, mapping_index: int) -> tuple[list[_Field], int]:
    """Return the fields of a mapping, without dummies, and its length in bytes: the last may be used in part."""
    fields, shift = [], 0
    for subindex in range(1, dictionary.get(address_of(mapping_index)) + 1):
        word = dictionary.get(address_of(mapping_index, subindex))
        address, bits = word >> 8, word & 0xFF
        if address >> 8 not in DUMMY_BITS:
            sign_bit = 1 << bits - 1 if dictionary.is_signed(address) else 0
            fields.append(_Field(address, dictionary.cell(address), shift, (1 << bits) - 1, sign_bit))
        shift += bits
    return fields, -(-shift // 8)


class _Target(NamedTuple):
    """A field of a receive PDO, and the place of its value."""

    field: _Field
    cell: MappedCell
    plain: bool


def _by_stage(fields: list[_Field]) -> list[list[_Target]]:
    """Return the fields of a receive PDO by their stages; the number that queues a record is the last of its fields.

    Fields of a record whose number comes by another PDO are parameters: they must be in place before it.
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
    """One receive PDO, as the dictionary describes it."""

    def __init__(self, dictionary: MappedObjects, parameters: PdoParameters, on_refused: Callable[[int], None]) -> None:
        """Read the parameters; call `on_refused`, with its word of a mapping, for each value that is refused."""
        communication = parameters.communication
        self.cob_id: int = dictionary.get(address_of(communication, od.PDO_COB_ID))
        self.exists: bool = not self.cob_id & COB_ID_INVALID
        """True if its COB-ID is valid."""
        self.synchronous: bool = (
            dictionary.get(address_of(communication, od.PDO_TRANSMISSION_TYPE)) <= _LAST_SYNCHRONOUS
        )
        self.timeout_us: int = dictionary.get(address_of(communication, od.PDO_EVENT_TIMER)) * _MS_US
        """Longest time between two frames; 0: any."""
        self.deadline_us: int | None = None
        """Time when the next frame is late; None while none is awaited."""
        fields, self._length = _fields(dictionary, parameters.mapping)
        self._by_stage = _by_stage(fields)
        self._in_order = [target for targets in self._by_stage for target in targets]
        self._latched: bytes | None = None
        self._on_refused = on_refused

    def receive(self, data: bytes) -> ErrorCode:
        """Take a frame: let it act now, or latch it for the next SYNC; return the error in its length, or NONE."""
        excess = len(data) - self._length
        if excess < 0:
            return ErrorCode.PDO_TOO_SHORT
        if self.synchronous:
            self._latched = data
        else:
            self.act(data)
        return ErrorCode.PDO_TOO_LONG if excess else _NO_ERROR

    def timed_out(self, now_us: int) -> bool:
        """Return whether the next frame is late by now, once."""
        if self.deadline_us is None or now_us < self.deadline_us:
            return False
        self.deadline_us = None
        return True

    def take_latched(self) -> bytes | None:
        """Return the frame that was latched last, if one came since the last call."""
        data, self._latched = self._latched, None
        return data

    def act(self, data: bytes, stage: ImageStage | None = None) -> None:
        """Let the values of a frame act: all in their order, or those of one stage."""
        targets = self._in_order if stage is None else self._by_stage[stage]
        bits = _integer(data[: self._length], "little")
        for field, cell, plain in targets:
            value = ((bits >> field.shift & field.mask) ^ field.sign_bit) - field.sign_bit
            if plain:  # most values are the fields of a PVT record, whose last one queues it
                cell.value = value
                continue
            try:
                cell.put(value)
            except SdoAbortError:
                self._on_refused(field.address << 8 | field.mask.bit_length())


def act_on_sync(pdos: Iterable[ReceivePdo]) -> None:
    """Let all frames act that were latched for this SYNC, as one process image."""
    latched = [(pdo, data) for pdo in pdos if (data := pdo.take_latched()) is not None]
    for stage in _ALL_STAGES if len(latched) > 1 else _AT_ONCE:
        for pdo, data in latched:
            pdo.act(data, stage)


class TransmitPdo:
    """One transmit PDO, as the dictionary describes it, with its timers."""

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
            dictionary: has the parameters and the values.
            parameters: their indexes.
            now_us: the present.
            sync_counter_overflow: the value of 1019h; 0: SYNC carries no counter.
            announced: entries whose changes `trigger` tells, by which type 255 goes; None: those of all, for any type.
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
        told = announced is None or (self.transmission_type > ANY_CHANGE and bool(self.addresses & announced))
        self._sampled = self.event_driven and bool(fields) and not told
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
        """Send as soon as the inhibit time allows, because a mapped value has changed."""
        self._wanted = True

    def on_sync(self, counter: int = 0) -> Frame | None:
        """Count a SYNC; return the frame if the transmission type requires one now.

        If the PDO has a SYNC start value, counting begins with the SYNC that carries it (CiA 301, section 7.5.2.37).
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
        """Instant when `poll` has work to do; None if only an event or a SYNC can cause it."""
        if not self.event_driven:
            return None
        if self._wanted:
            return self._not_before_us
        due_us = self._timer_us if self._event_timer_us else None
        if self._sampled and (due_us is None or self._sample_due_us < due_us):
            due_us = self._sample_due_us
        return None if due_us is None else max(due_us, self._not_before_us)

    def poll(self, now_us: int) -> Frame | None:
        """Return the frame if it is due, else None: its time has not come, or a sample shows no change."""
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
    """All PDOs of a node; `refresh` rebuilds them from the dictionary after their parameters have changed."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self.receive_pdos: list[ReceivePdo] = []
        self.transmit_pdos: list[TransmitPdo] = []
        dictionary.bind(self)
        self.configurable = True
        """True in PRE-OPERATIONAL, the only state that lets PDO parameters be written."""
        self._changed = True

    def refresh(self, now_us: int) -> bool:
        """Rebuild the PDOs if their parameters have changed; return True if they have."""
        if not self._changed:
            return False
        self._changed = False
        overflow = self._dictionary.get(od.SYNC_COUNTER_OVERFLOW)
        self.receive_pdos = [ReceivePdo(self._dictionary, each, self._note_refused) for each in _RECEIVE]
        self.transmit_pdos = [TransmitPdo(self._dictionary, each, now_us, overflow) for each in _TRANSMIT]
        return True

    def _note_refused(self, word: int) -> None:
        """Count a value that an RPDO brought and the dictionary refused, and keep its place."""
        self._dictionary.cell(od.RPDO_VALUES_REFUSED).count()
        self._dictionary.set(od.RPDO_LAST_REFUSED, word)

    def invalidate(self) -> None:
        """Let the next `refresh` rebuild the PDOs: their parameters were reset, or their timers must restart."""
        self._changed = True

    def changed(self, address: int) -> None:
        """Trigger the transmit PDOs that carry an entry whose value has changed."""
        for pdo in self.transmit_pdos:
            if address in pdo.addresses:
                pdo.trigger()

    def sync_counter(self, data: bytes) -> int | None:
        """Return the counter of a SYNC frame, 0 if SYNC carries none; None if the frame's length is wrong.

        The synchronous counter overflow value (1019h) says whether SYNC carries a counter (CiA 301, section 7.2.5).
        """
        counted = self._dictionary.get(od.SYNC_COUNTER_OVERFLOW) != 0
        if len(data) != counted:
            return None
        return data[0] if counted else 0

    def check_sync_overflow(self, value: int) -> None:
        """Refuse 1 (the object table bounds the value to 0..240), and any value while a cycle period (1006h) is set.

        That period concerns SYNC producers only; it is stored and has no other effect (CiA 301, section 7.5.2.19).
        """
        if value == 1:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if self._dictionary.get(od.COMMUNICATION_CYCLE_PERIOD):
            raise SdoAbortError(AbortCode.DEVICE_STATE)

    def check_configurable(self, _value: int) -> None:
        """Refuse any change of a parameter outside of PRE-OPERATIONAL; a change that is allowed rebuilds the PDOs."""
        if not self.configurable:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self._changed = True

    def check_cob_id_at(self, address: int, value: int) -> None:
        """Refuse a value that is not a COB-ID of a PDO, and a new one for a PDO that exists."""
        self.check_configurable(value)
        check_cob_id(self._dictionary.get(address), value, COB_ID_NO_RTR)

    def check_transmission_type(self, value: int) -> None:
        """Refuse types 241 to 251, which are reserved, and 252 and 253, which need remote frames."""
        self.check_configurable(value)
        if _LAST_SYNCHRONOUS < value < ANY_CHANGE:
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    def check_while_invalid_at(self, address: int, value: int) -> None:
        """Refuse a change of mapping, inhibit time or SYNC start value while the PDO exists."""
        self.check_configurable(value)
        communication = _COMMUNICATION.get(address >> 8, address >> 8)
        if not self._dictionary.get(address_of(communication, od.PDO_COB_ID)) & COB_ID_INVALID:
            raise SdoAbortError(AbortCode.DEVICE_STATE)

    def check_count_at(self, address: int, count: int) -> None:
        """Refuse a number of mapped entries if some are not given, or if they are too long together."""
        self.check_while_invalid_at(address, count)
        words = [self._dictionary.get(address + i) for i in range(1, count + 1)]
        if 0 in words:
            raise SdoAbortError(AbortCode.CANNOT_BE_MAPPED)
        if sum(word & 0xFF for word in words) > 64:
            raise SdoAbortError(AbortCode.PDO_TOO_LONG)

    def check_mapped_at(self, address: int, word: int) -> None:
        """Refuse what cannot be mapped into this kind of PDO, and any change while the number of entries is not 0."""
        self.check_while_invalid_at(address, word)
        if self._dictionary.get(address_of(address >> 8)):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        entry = self._dictionary.entries.get(word >> 8)
        kind = Mapping.RECEIVE if address >> 8 in od.RPDO_MAPPING else Mapping.TRANSMIT
        if kind is Mapping.RECEIVE and word in _DUMMIES:
            return
        if word and (entry is None or not _mappable(entry, kind, word & 0xFF)):
            raise SdoAbortError(AbortCode.CANNOT_BE_MAPPED)


def _mappable(entry: Entry, access: Mapping, bits: int) -> bool:
    if entry.access is Access.CONST or bits != 8 * entry.data_type.size:
        return False
    return bool(entry.mapping.value & access.value)
