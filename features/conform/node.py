"""The node under test, from the side of a master: its frames, SDO requests byte by byte, NMT states."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, NamedTuple

from steptwin.features.conform.check import FailedError, SkippedError, expect
from steptwin.features.nodes.eds_file import EdsSection, read_sections
from steptwin.features.nodes.eds_nodes import EDS_BYTES_MAX, entries_of
from steptwin.features.nodes.node_objects import NodeEntry
from steptwin.host.client.links import Link
from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import read_old_text
from steptwin.protocol import cia402, od
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_ID_MASK,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    REMOTE,
    Frame,
)
from steptwin.protocol.nmt import NmtCommand, NmtState, target_of
from steptwin.protocol.sdo_frames import (
    ABORT,
    DOWNLOAD,
    EXPEDITED,
    EXPEDITED_BYTES_MAX,
    SDO_BYTES,
    SIZE_INDICATED,
    SPECIFIER,
    UPLOAD,
    AbortCode,
    download_request,
    object_bytes,
    upload_request,
    value_bytes,
)

ANSWER_S: Final = 1.0
"""Time in which a server must answer."""
BOOT_S: Final = 5.0
"""Time in which a node must send its boot-up message after a reset."""
GUARD_S: Final = 0.2
"""Time in which a node must answer node guarding."""
HEARTBEAT_MS: Final = 50
_POLL_S: Final = 0.001
_SEGMENT_BYTES: Final = 7
_TOGGLE: Final = 0x10
_LAST: Final = 0x01
_SEGMENTS_MAX: Final = 10_000

DEVICE_TYPE: Final = od.address_of(0x1000)
DEVICE_NAME: Final = od.address_of(0x1008)
HEARTBEAT_TIME: Final = od.address_of(0x1017)
MODE: Final = od.address_of(0x6060)
MODE_DISPLAY: Final = od.address_of(0x6061)
CONTROLWORD: Final = od.address_of(0x6040)
STATUSWORD: Final = od.address_of(0x6041)


class Traffic(NamedTuple):
    """A frame on the bus.

    Attributes:
        t_s: instant by the link's clock.
        sent: True for a frame of the tester.
        frame: the frame.
    """

    t_s: float
    sent: bool
    frame: Frame

    def __str__(self) -> str:
        direction = ">" if self.sent else "<"
        cob_id, data = self.frame
        content = "remote" if cob_id & REMOTE else f"[{len(data)}] {data.hex(' ')}"
        return f"{self.t_s:.6f} {direction} {cob_id & COB_ID_MASK:03X} {content}"


@dataclass(frozen=True, slots=True)
class Description:
    """What an EDS says of a node.

    Attributes:
        sections: its sections by their names in small letters.
        entries: its objects by address.
    """

    sections: Mapping[str, EdsSection]
    entries: Mapping[int, NodeEntry]

    @classmethod
    def read(cls, path: str, node_id: int) -> "Description":
        """Return what a file says; raise InputError, with section and key, for what cannot be read."""
        sections = read_sections(read_old_text(path, EDS_BYTES_MAX))
        if "deviceinfo" not in sections:
            raise InputError("has no section [DeviceInfo], so it is no EDS")
        return cls(sections, entries_of(sections, node_id))


class AbortError(Exception):
    """The server's abort of an SDO transfer."""

    def __init__(self, code: int) -> None:
        try:
            name = f" ({AbortCode(code).name})"
        except ValueError:
            name = ""
        super().__init__(f"abort {code:08X}h{name}")
        self.code = code


def said(code: int, done: str = "is accepted") -> str:
    """Return how a request has ended: with an abort, or done if the code is 0."""
    return str(AbortError(code)) if code else done


class NodeUnderTest:
    """A node on a bus, asked frame by frame.

    Attributes:
        node_id: its id.
        described: what its EDS says; nothing without an EDS.
        traffic: frames of the check that runs, in order.
    """

    def __init__(self, link: Link, node_id: int, described: Description | None = None) -> None:
        self._link = link
        self.node_id: Final = node_id
        self.described: Final = described or Description({}, {})
        self.traffic: list[Traffic] = []
        for cob_id in range(1, 0x800):
            link.network.subscribe(cob_id, self._received)

    def _received(self, cob_id: int, data: bytearray, _at_s: float) -> None:
        self.traffic.append(Traffic(self._link.now_s(), False, Frame(cob_id, bytes(data))))

    # --- frames

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame."""
        self.traffic.append(Traffic(self._link.now_s(), True, Frame(cob_id, data)))
        self._link.network.send_message(cob_id, data)

    def request_state(self) -> int | None:
        """Ask for the NMT state by node guarding; return the answer's byte, None without an answer.

        Raises:
            SkippedError: the interface is python-can's socketcand, which would send a data frame instead.
        """
        if type(self._link.network.bus).__module__.startswith("can.interfaces.socketcand"):
            raise SkippedError("python-can's socketcand interface sends no remote frames")
        mark, cob_id = self.mark(), COB_HEARTBEAT + self.node_id
        self.traffic.append(Traffic(self._link.now_s(), True, Frame(REMOTE | cob_id, b"")))
        self._link.network.send_message(cob_id, b"\0", remote=True)
        answer = self.within(GUARD_S, mark, cob_id)
        return answer.frame.data[0] if answer and len(answer.frame.data) == 1 else None

    def wait(self, dt_s: float) -> None:
        """Wait, and receive what comes."""
        self._link.wait(dt_s)

    def now_s(self) -> float:
        """Return the seconds of the link's clock."""
        return self._link.now_s()

    def mark(self) -> int:
        """Return the place in the traffic that `since` takes."""
        return len(self.traffic)

    def since(self, mark: int, cob_id: int) -> list[Traffic]:
        """Return the frames of an identifier that were received since a place in the traffic."""
        return [each for each in self.traffic[mark:] if not each.sent and each.frame.cob_id == cob_id]

    def within(
        self, seconds: float, mark: int, cob_id: int, wanted: Callable[[bytes], bool] | None = None
    ) -> Traffic | None:
        """Wait for a frame of an identifier since a place in the traffic; return it, None if it does not come."""
        until_s = self.now_s() + seconds
        while True:
            for each in self.since(mark, cob_id):
                if wanted is None or wanted(each.frame.data):
                    return each
            if self.now_s() >= until_s:
                return None
            self.wait(_POLL_S)

    # --- SDO

    def request(self, data: bytes, seconds: float = ANSWER_S) -> bytes | None:
        """Send an SDO request of any bytes; return the answer; None if none comes."""
        mark = self.mark()
        self.send(COB_SDO_REQUEST + self.node_id, data)
        answer = self.within(seconds, mark, COB_SDO_RESPONSE + self.node_id)
        return None if answer is None else answer.frame.data

    def answer(self, data: bytes) -> bytes:
        """Return the answer to an SDO request.

        Raises:
            FailedError: none comes within a second, or it has not eight bytes.
            AbortError: the server aborts.
        """
        answer = self.request(data)
        if answer is None:
            raise FailedError(f"no answer to {data.hex(' ')} within {ANSWER_S:g} s")
        expect(len(answer) == SDO_BYTES, f"an SDO answer has {len(answer)} bytes, not {SDO_BYTES}")
        if answer[0] & SPECIFIER == ABORT:
            raise AbortError(int.from_bytes(answer[4:8], "little"))
        return answer

    def upload(self, address: int) -> bytes:
        """Read an object, expedited or by segments; raises as `answer`, and FailedError for a wrong protocol."""
        answer = self.answer(upload_request(address))
        expect(answer[0] & SPECIFIER == UPLOAD, f"answer {answer[0]:02X}h to an upload of {od.place_text(address)}")
        if answer[0] & EXPEDITED:
            return value_bytes(answer)
        size = int.from_bytes(answer[4:8], "little") if answer[0] & SIZE_INDICATED else None
        data, toggle = bytearray(), 0
        for _ in range(_SEGMENTS_MAX):
            segment = self.answer(bytes((0x60 | toggle,)).ljust(SDO_BYTES, b"\0"))
            expect(
                segment[0] & (SPECIFIER | _TOGGLE) == toggle, f"segment with {segment[0]:02X}h, toggle {toggle >> 4}"
            )
            data += segment[1 : SDO_BYTES - (segment[0] >> 1 & 7)]
            toggle ^= _TOGGLE
            if segment[0] & _LAST:
                break
        expect(size in (None, len(data)), f"{od.place_text(address)} says {size} bytes and sends {len(data)}")
        return bytes(data)

    def download(self, address: int, data: bytes) -> None:
        """Write an object, expedited or by segments; raises as `answer`, and FailedError for a wrong protocol."""
        if 0 < len(data) <= EXPEDITED_BYTES_MAX:
            answer = self.answer(download_request(address, data))
        else:
            answer = self.begin_segments(address, len(data))
            toggle = 0
            for first in range(0, max(len(data), 1), _SEGMENT_BYTES):
                part = data[first : first + _SEGMENT_BYTES]
                last = first + _SEGMENT_BYTES >= len(data)
                sent = self.answer(segment(part, toggle, last=last))
                expect(sent[0] & 0xF0 == 0x20 | toggle, f"answer {sent[0]:02X}h to a segment with toggle {toggle >> 4}")
                toggle ^= _TOGGLE
        expect(answer[0] & SPECIFIER == 0x60, f"answer {answer[0]:02X}h to a download of {od.place_text(address)}")
        expect(answer[1:4] == object_bytes(address), f"the answer names another object than {od.place_text(address)}")

    def begin_segments(self, address: int, size: int) -> bytes:
        """Begin a segmented download; return the answer."""
        return self.answer(bytes((DOWNLOAD | SIZE_INDICATED,)) + object_bytes(address) + size.to_bytes(4, "little"))

    def number(self, address: int, *, signed: bool = False) -> int:
        """Read a whole number."""
        return int.from_bytes(self.upload(address), "little", signed=signed)

    def has(self, address: int) -> bool:
        """Return True if the node has an object that can be read."""
        return not self.read_code(address)

    def needed(self, address: int) -> bytes:
        """Read an object that a check needs; raise SkippedError if the node does not have it."""
        try:
            return self.upload(address)
        except AbortError as error:
            raise SkippedError(f"no {od.place_text(address)} ({error})") from error

    def read_code(self, address: int) -> int:
        """Read an object; return the code of the abort with which that ends, 0 if it succeeds."""
        try:
            self.upload(address)
        except AbortError as error:
            return error.code
        return 0

    def write_code(self, address: int, data: bytes) -> int:
        """Write an object; return the code of the abort with which that ends, 0 if it succeeds."""
        try:
            self.download(address, data)
        except AbortError as error:
            return error.code
        return 0

    @contextmanager
    def kept(self, address: int) -> Iterator[bytes]:
        """Give the value of an object to the block, and write it back afterwards."""
        before = self.needed(address)
        try:
            yield before
        finally:
            if self.upload(address) != before:
                self.download(address, before)

    # --- NMT

    def command(self, command: int, node_id: int | None = None) -> None:
        """Send an NMT command; by default to this node."""
        self.send(COB_NMT, bytes((command, self.node_id if node_id is None else node_id)))

    def state(self) -> int:
        """Return the NMT state by the next heartbeat; raise FailedError without one."""
        heartbeat = self.within(ANSWER_S, self.mark(), COB_HEARTBEAT + self.node_id, lambda data: data != b"\0")
        if heartbeat is None:
            raise FailedError(f"no heartbeat within {ANSWER_S:g} s")
        return heartbeat.frame.data[0] & 0x7F

    def enter(self, state: NmtState) -> None:
        """Bring the node into an NMT state; raise FailedError if its heartbeat does not say so."""
        self.command(next(command for command in NmtCommand if target_of(command) is state))
        heartbeat = bytes((state,))
        wanted = self.within(ANSWER_S, self.mark(), COB_HEARTBEAT + self.node_id, lambda data: data == heartbeat)
        expect(wanted is not None, f"no heartbeat with {state.value:02X}h within {ANSWER_S:g} s")

    def reset(self, command: NmtCommand) -> list[Traffic]:
        """Reset the node and wait for its boot-up; return the frames of its heartbeat's identifier since the command.

        The heartbeat runs again afterwards.
        """
        mark = self.mark()
        self.command(command)
        booted = self.within(BOOT_S, mark, COB_HEARTBEAT + self.node_id, lambda data: data == b"\0")
        expect(booted is not None, f"no boot-up within {BOOT_S:g} s after {command.name}")
        self.wait(0.1)
        frames = self.since(mark, COB_HEARTBEAT + self.node_id)
        self.produce_heartbeat()
        return frames

    def produce_heartbeat(self) -> None:
        """Let the node send its heartbeat; raise InputError if it cannot."""
        if code := self.write_code(HEARTBEAT_TIME, HEARTBEAT_MS.to_bytes(2, "little")):
            raise InputError(f"node 0x{self.node_id:02X}: without 0x1017 its state is not seen ({said(code)})")

    def sync(self) -> None:
        """Send a SYNC."""
        self.send(COB_SYNC, b"")

    # --- the drive

    @property
    def is_drive(self) -> bool:
        """True for a node of CiA 402."""
        return self.number(DEVICE_TYPE) & 0xFFFF == 402

    def drive_state(self) -> cia402.State:
        """Return the state of the drive."""
        return cia402.State.of(self.number(STATUSWORD))

    def control(self, word: int) -> None:
        """Write the controlword."""
        self.download(CONTROLWORD, word.to_bytes(2, "little"))

    def reached(self, state: cia402.State, seconds: float = ANSWER_S) -> bool:
        """Wait for a state of the drive; return False if it does not come."""
        until_s = self.now_s() + seconds
        while self.drive_state() is not state:
            if self.now_s() >= until_s:
                return False
            self.wait(0.01)
        return True

    def switched_off(self) -> None:
        """Bring the drive to SWITCH ON DISABLED; raise SkippedError if it has a fault that stays."""
        if not self.is_drive:
            return
        if self.drive_state() is cia402.State.FAULT:
            self.control(0)
            self.control(cia402.Control.FAULT_RESET)
        self.control(cia402.DISABLE_VOLTAGE)
        if not self.reached(cia402.State.SWITCH_ON_DISABLED):
            raise SkippedError(f"the drive stays in {self.drive_state().name}")

    # --- PDO

    def emergencies(self, mark: int) -> list[bytes]:
        """Return the EMCY messages since a place in the traffic."""
        return [each.frame.data for each in self.since(mark, COB_EMCY + self.node_id)]

    def valid_pdos(self, first_index: int) -> dict[int, int]:
        """Return the identifiers of the PDOs in use, by the index of their parameters."""
        found = {}
        for index in range(first_index, first_index + 8):
            if self.read_code(od.address_of(index, 1)):
                continue
            word = self.number(od.address_of(index, 1))
            if not word & COB_ID_INVALID:
                found[index] = word & 0x7FF
        return found


def u32(value: int) -> bytes:
    """Return a value of four bytes as SDO carries it."""
    return value.to_bytes(4, "little")


def segment(part: bytes, toggle: int, *, last: bool) -> bytes:
    """Return a segment of a download, with up to seven bytes."""
    unused = _SEGMENT_BYTES - len(part)
    return bytes((toggle | unused << 1 | last,)) + part.ljust(_SEGMENT_BYTES, b"\0")
