"""A simple CANopen node: boot-up, NMT, heartbeat, SDO server, PDOs and EMCY by its object dictionary (CiA 301).

It implements its description, but no application behind the values: an output is a value that a master has written, an
input one that the machine around the node has set. It has no time-outs, stores nothing and does not listen to
heartbeats. The CAN controller sends its waiting frames by identifier.
"""

from typing import Final

from steptwin.emulator.bus.can_controller import CanController
from steptwin.features.nodes.node_objects import (
    PDO_BITS_MAX,
    RPDO_MAPS,
    RPDOS,
    TPDO_MAPS,
    TPDOS,
    NodeDescription,
    NodeObjects,
    NodeValue,
)
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import check_cob_id
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_ID_MASK,
    COB_ID_NO_RTR,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    REMOTE,
    Frame,
)
from steptwin.protocol.nmt import GuardedNode, HeartbeatProducer, NmtCommand, NmtState, command_for, target_of
from steptwin.protocol.objects import ANY_CHANGE
from steptwin.protocol.pdo import PdoParameters, ReceivePdo, TransmitPdo, act_on_sync
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError
from steptwin.protocol.sdo_server import SdoServer
from steptwin.protocol.timer import COUNTS_PER_US

WAITING_MAX: Final = 256
"""Largest number of waiting frames: those of two SDO blocks."""
_LAST_SYNCHRONOUS: Final = 240
_HISTORY: Final = 0x1003
_GENERIC_ERROR: Final = 0x01
_COMMUNICATION_ERROR: Final = 0x10
"""Bits of the error register (1001h)."""
_EMCY_DATA_BYTES: Final = 5
_MS_US: Final = 1000


class SimpleNode:
    """A node at a CAN controller of its own; the simulation calls `boot`, and `poll` at `next_due_counts`."""

    def __init__(self, description: NodeDescription) -> None:
        self.description = description
        self.node_id: int = description.node_id
        self.nmt_state: NmtState = NmtState.INITIALISING
        self._accepted: frozenset[int] = frozenset()
        self.can: CanController = self._new_controller()
        self.powered: bool = True
        """False while the node has no supply; `Simulation.switch_node` changes it."""
        self.refused: int = 0
        """Number of values in RPDOs outside the description's limits."""
        self.dropped: int = 0
        """Number of frames that were not sent because too many were waiting."""
        self._objects = objects = NodeObjects(description)
        self._history = [place for place in range(_HISTORY << 8 | 1, _HISTORY << 8 | 0xFF) if place in objects.entries]
        """Addresses of the entries of the error history."""
        self._sync_cob_id = COB_SYNC
        self._sdo = SdoServer(objects)
        self._heartbeat = HeartbeatProducer()
        self._guarded = GuardedNode()
        self._receive_pdos: list[ReceivePdo] = []
        self._transmit_pdos: list[TransmitPdo] = []
        self._pdo_errors: dict[int, ErrorCode] = {}
        """Length error of the last frame of each RPDO, by its number from 1 on."""
        self._rebuild_due = self._heartbeat_due = False
        self._outside: list[Frame] = []
        """Emergencies from the machine around the node since the last poll."""
        self._now_us = 0
        self.next_due_counts: int | None = None
        """Instant when `poll` has work; None if only a frame or an outside change triggers it."""
        objects.changed, objects.check = self._changed, self._check

    def _new_controller(self) -> CanController:
        return CanController(self._receive, passes=lambda cob_id: cob_id in self._accepted)

    # --- access from outside

    @property
    def values(self) -> dict[int, NodeValue]:
        """The present value of each entry, by its address: index << 8 | sub-index."""
        return {address: self._objects.value(address) for address in self.description.entries}

    def value(self, address: int) -> NodeValue:
        """Return an entry's value; raise KeyError if there is no entry."""
        return self._objects.value(address)

    def set_value(self, address: int, value: NodeValue) -> None:
        """Set an entry's value, as the machine around the node does; this may trigger TPDOs.

        Raises:
            KeyError: there is no entry.
            ValueError: the type does not have this value.
        """
        self._objects.set_value(address, value)
        self.next_due_counts = 0

    def emergency(self, code: int, register: int = _GENERIC_ERROR, data: bytes = b"") -> None:
        """Send an EMCY as soon as the bus is free, unless the node is stopped; code 0 ends the error.

        Args:
            code: error code; the newest is first in the history (1003h), if the node has one.
            register: new value of the error register (1001h); with code 0 it is usually 0.
            data: up to 5 manufacturer-specific bytes.

        Raises:
            ValueError: a value is out of its range.
        """
        if not 0 <= code <= 0xFFFF:
            raise ValueError(f"code {code} is not from 0 to {0xFFFF}")
        if not 0 <= register <= 0xFF:
            raise ValueError(f"register {register} is not from 0 to {0xFF}")
        if len(data) > _EMCY_DATA_BYTES:
            raise ValueError(f"data: {len(data)} bytes are more than {_EMCY_DATA_BYTES}")
        if od.ERROR_REGISTER in self.description.entries:
            self._objects.set_value(od.ERROR_REGISTER, register)
        if code:
            self._remember(code)
        cob_id = self._objects.get(od.EMCY_COB_ID) or COB_EMCY + self.node_id
        if not cob_id & COB_ID_INVALID:
            payload = code.to_bytes(2, "little") + bytes((register,)) + data.ljust(_EMCY_DATA_BYTES, b"\0")
            self._outside.append(Frame(cob_id & COB_ID_MASK, payload))
        self.next_due_counts = 0

    def _remember(self, code: int) -> None:
        """Insert an error code at the start of the history, if the node has one."""
        if od.ERROR_HISTORY_COUNT not in self._objects.entries:
            return
        places = self._history
        count = min(self._objects.get(od.ERROR_HISTORY_COUNT), len(places))
        codes = [code, *(self._objects.get(place) for place in places[:count])][: len(places)]
        for place, each in zip(places, codes, strict=False):
            self._objects.set_value(place, each)
        self._objects.set_value(od.ERROR_HISTORY_COUNT, len(codes))

    # --- power-up and network management

    def boot(self, now_counts: int) -> None:
        """Power up: announce the node, then wait in PRE-OPERATIONAL."""
        self._now_us = now_counts // COUNTS_PER_US
        self._reset(now_counts)

    def power_down(self) -> None:
        """Lose the supply and all values; `can` is replaced by a controller that is not on the bus."""
        self.powered = False
        self.nmt_state = NmtState.INITIALISING
        self.next_due_counts = None
        self.can = self._new_controller()
        self.can.power_down()

    def power_up(self) -> None:
        """Get the supply back; the caller attaches the controller to the bus, and calls `boot`."""
        self.powered = True
        self.can.power_up()

    def _reset(self, now_counts: int, *, last_index: int = 0xFFFF) -> None:
        self._objects.reset(last_index=last_index)
        self._sdo.reset()
        self._pdo_errors.clear()
        self._outside.clear()
        self._enter(NmtState.PRE_OPERATIONAL)
        self._send(Frame(COB_HEARTBEAT + self.node_id, bytes((NmtState.INITIALISING,))), now_counts)
        self._heartbeat_due = True
        self._end_call(now_counts)

    def _enter(self, state: NmtState) -> None:
        """Change the NMT state; process data restart, and event-driven ones are sent once on entering OPERATIONAL."""
        self.nmt_state = state
        self._rebuild()
        if state is NmtState.OPERATIONAL:
            for pdo in self._transmit_pdos:
                if pdo.exists and pdo.transmission_type >= ANY_CHANGE:
                    pdo.trigger()

    def _rebuild(self) -> None:
        objects, now_us = self._objects, self._now_us
        overflow = objects.get(od.SYNC_COUNTER_OVERFLOW)
        receive = [PdoParameters(*each) for each in objects.pdos(RPDOS)]
        transmit = [PdoParameters(*each) for each in objects.pdos(TPDOS)]
        self._receive_pdos = [ReceivePdo(objects, each, self._count_refused) for each in receive]
        self._transmit_pdos = [TransmitPdo(objects, each, now_us, overflow, announced=None) for each in transmit]
        self._sync_cob_id = (objects.get(od.SYNC_COB_ID) or COB_SYNC) & COB_ID_MASK
        taken = (pdo.cob_id & COB_ID_MASK for pdo in self._receive_pdos if pdo.exists)
        services = COB_NMT, COB_SDO_REQUEST + self.node_id, self._sync_cob_id, REMOTE | COB_HEARTBEAT + self.node_id
        self._accepted = frozenset((*services, *taken))
        self._rebuild_due = False

    def _count_refused(self, _word: int) -> None:
        self.refused += 1

    # --- the node's reaction to values

    def _changed(self, address: int) -> None:
        index = address >> 8
        if address == od.PRODUCER_HEARTBEAT_TIME:
            self._heartbeat_due = True
        elif RPDOS.start <= index < TPDO_MAPS.stop or address in (od.SYNC_COUNTER_OVERFLOW, od.SYNC_COB_ID):
            self._rebuild_due = True
        elif address == od.ERROR_HISTORY_COUNT and not self._objects.get(address):
            for place in self._history:
                self._objects.set_value(place, 0)
        for pdo in self._transmit_pdos:
            if address in pdo.addresses:
                pdo.trigger()

    def _check(self, address: int, value: int) -> None:
        """Reject values that would make process data inconsistent (CiA 301, sections 7.5.2.36 to 7.5.2.38)."""
        index, subindex = address >> 8, address & 0xFF
        if address == od.ERROR_HISTORY_COUNT and value:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if not RPDOS.start <= index < TPDO_MAPS.stop:
            return
        if self.nmt_state is not NmtState.PRE_OPERATIONAL:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if index in RPDO_MAPS or index in TPDO_MAPS:
            self._check_mapping(address, value)
        elif subindex == od.PDO_COB_ID:
            check_cob_id(self._objects.get(address), value, COB_ID_NO_RTR)
        elif subindex == od.PDO_TRANSMISSION_TYPE and _LAST_SYNCHRONOUS < value < ANY_CHANGE:
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    def _check_mapping(self, address: int, value: int) -> None:
        index, objects = address >> 8, self._objects
        communication = index - RPDO_MAPS.start + RPDOS.start
        if not objects.get(communication << 8 | od.PDO_COB_ID) & COB_ID_INVALID:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if address & 0xFF:
            if objects.get(index << 8):
                raise SdoAbortError(AbortCode.DEVICE_STATE)
            if value and (why := objects.why_not_mapped(value, received=index in RPDO_MAPS)):
                raise SdoAbortError(why)
            return
        words = [objects.get(index << 8 | i) for i in range(1, value + 1)]
        if 0 in words:
            raise SdoAbortError(AbortCode.CANNOT_BE_MAPPED)
        if sum(word & 0xFF for word in words) > PDO_BITS_MAX:
            raise SdoAbortError(AbortCode.PDO_TOO_LONG)

    # --- received frames

    def _receive(self, frame: Frame, now_counts: int) -> None:
        self._now_us = now_counts // COUNTS_PER_US
        if frame.cob_id == COB_NMT:
            if command := command_for(frame.data, self.node_id):
                self._obey(command, now_counts)
        elif frame.cob_id == COB_SDO_REQUEST + self.node_id:
            if self.nmt_state is not NmtState.STOPPED:
                for answer in self._sdo.handle(frame.data):
                    self._send(Frame(COB_SDO_RESPONSE + self.node_id, answer), now_counts)
        elif frame.cob_id & REMOTE:
            self._answer_guarding(now_counts)
        elif self.nmt_state is NmtState.OPERATIONAL:
            if frame.cob_id == self._sync_cob_id:
                self._on_sync(frame.data, now_counts)
            for number, pdo in enumerate(self._receive_pdos, start=1):
                if pdo.exists and pdo.cob_id & COB_ID_MASK == frame.cob_id:
                    self._take(number, pdo.receive(frame.data))
        self._end_call(now_counts)

    def _answer_guarding(self, now_counts: int) -> None:
        """Answer a request of node guarding, if the node has a guard time (100Ch) and sends no heartbeats."""
        get = self._objects.get
        if od.GUARD_TIME not in self._objects.entries or self._heartbeat.period_us:
            return
        life_time_us = _MS_US * get(od.GUARD_TIME) * get(od.LIFE_TIME_FACTOR)
        if self._guarded.lost:
            self.emergency(ErrorCode.NONE, 0)
        answer = self._guarded.answer(self.nmt_state, life_time_us, self._now_us)
        self._send(Frame(COB_HEARTBEAT + self.node_id, answer), now_counts)

    def _obey(self, command: NmtCommand, now_counts: int) -> None:
        target = target_of(command)
        if command is NmtCommand.RESET_NODE:
            self._reset(now_counts)
        elif command is NmtCommand.RESET_COMMUNICATION:
            self._reset(now_counts, last_index=0x1FFF)
        elif target is not self.nmt_state:
            self._enter(target)

    def _take(self, number: int, error: ErrorCode) -> None:
        """Report an RPDO with a wrong length, and the next good one, once each."""
        if error is self._pdo_errors.get(number, ErrorCode.NONE):
            return
        if error:
            self._pdo_errors[number] = error
        else:
            del self._pdo_errors[number]
        self.emergency(error, _COMMUNICATION_ERROR if self._pdo_errors else 0, bytes((number,)) if error else b"")

    def _on_sync(self, data: bytes, now_counts: int) -> None:
        """Apply the RPDOs that wait for SYNC, then send the TPDOs of this SYNC; ignore a SYNC of wrong length."""
        counted = self._objects.get(od.SYNC_COUNTER_OVERFLOW) != 0
        if len(data) != counted:
            return
        act_on_sync(self._receive_pdos)
        for transmit_pdo in self._transmit_pdos:
            frame = transmit_pdo.on_sync(data[0] if counted else 0) if transmit_pdo.exists else None
            if frame:
                self._send(frame, now_counts)

    # --- sent frames

    def step(self, now_counts: int) -> None:
        """Do due work: emergencies from outside, heartbeat, event-driven TPDOs."""
        if self.next_due_counts is None or self.next_due_counts > now_counts:
            return
        if not self.powered:
            self.next_due_counts = None
            return
        self._now_us = now_counts // COUNTS_PER_US
        if self._heartbeat.poll(self._now_us):
            self._send(Frame(COB_HEARTBEAT + self.node_id, bytes((self.nmt_state,))), now_counts)
        if self._guarded.poll(self._now_us):
            self.emergency(ErrorCode.HEARTBEAT_LOST, _COMMUNICATION_ERROR)
        if self.nmt_state is NmtState.OPERATIONAL:
            for pdo in self._transmit_pdos:
                frame = pdo.poll(self._now_us) if pdo.exists else None
                if frame:
                    self._send(frame, now_counts)
        self._end_call(now_counts)

    def _end_call(self, now_counts: int) -> None:
        """Apply changed parameters, send what the outside has requested, and schedule the next poll."""
        if self._rebuild_due:
            self._rebuild()
        if self._heartbeat_due:
            self._heartbeat_due = False
            self._heartbeat.set_period(self._objects.get(od.PRODUCER_HEARTBEAT_TIME) * _MS_US, self._now_us)
            self._guarded.restart()
        outside, self._outside = self._outside, []
        if self.nmt_state is not NmtState.STOPPED:
            for frame in outside:
                self._send(frame, now_counts)
        dues_us = [self._heartbeat.due_us, self._guarded.due_us]
        if self.nmt_state is NmtState.OPERATIONAL:
            dues_us += [pdo.due_us for pdo in self._transmit_pdos if pdo.exists]
        known = [due_us for due_us in dues_us if due_us is not None]
        self.next_due_counts = min(known) * COUNTS_PER_US if known else None

    def _send(self, frame: Frame, now_counts: int) -> None:
        if self.can.waiting < WAITING_MAX:
            self.can.send(frame, now_counts)
        else:
            self.dropped += 1
