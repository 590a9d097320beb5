"""A live board whose time the test advances, and the frames that move its axes."""

from collections.abc import Sequence
from pathlib import Path

from steptwin.controller.motion.backend import Kernel
from steptwin.host.robots import load_robot
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord

ROBOT = load_robot("warehouse-scara")
JOINT = 3
"""The joint that moves, th1: its steps and units are those of 1/16."""
NODE = 0x10 + JOINT
UNITS_PER_STEP = 1024
THERE_AND_BACK = (PvtRecord(20 * UNITS_PER_STEP, 0, 50, 0), PvtRecord(-20 * UNITS_PER_STEP, 0, 50, 1))
"""20 steps up and down again in 100 ms."""
NMT_START = Frame(0x000, b"\x01\x00")
SYNC = Frame(0x080, b"")
PVT, PROFILE_POSITION = 7, 1
"""Modes of operation."""
_MS_IN_NS = 1_000_000
_RECORD_EVERY_NS = 50 * _MS_IN_NS


def control(controlword: int, mode: int = PVT, node: int = NODE) -> Frame:
    """Return the RPDO with a controlword and a mode of operation."""
    return Frame(0x200 + node, controlword.to_bytes(2, "little") + bytes((mode,)))


def enable(mode: int = PVT, node: int = NODE) -> list[Frame]:
    """Return the frames that lead an axis to OPERATION ENABLED."""
    return [control(controlword, mode, node) for controlword in (0x06, 0x07, 0x0F)]


def queue(*records: PvtRecord, node: int = NODE) -> list[Frame]:
    """Return the frames that put records into an axis' queue."""
    return [Frame(0x500 + node, record.encode()) for record in records]


def start_at_sync(node: int = NODE) -> Frame:
    """Return the RPDO that lets an axis run its queue from the next SYNC on."""
    return Frame(0x300 + node, b"\x1f\x00")


class LiveSession:
    """Sends frames to a live board and lets its time pass; the board records every 50 ms."""

    def __init__(
        self,
        kernel: Kernel,
        out: Path | None = None,
        log: Path | None = None,
        axes_per_board: tuple[int, ...] | None = None,
        crystals_ppm: tuple[int, ...] = (),
        drivers: str | None = None,
        *,
        extras: Sequence[object] = (),
        stride_ms: int = 1,
        pieces: int = 0,
    ) -> None:
        self._stride_ms = stride_ms
        self._pieces = pieces
        """Pieces of a stretch by which rotors may follow after each stride."""
        self.board = LiveBoard(
            ROBOT,
            kernel,
            MachineOptions(
                axes_per_board=axes_per_board,
                crystal_ppm=crystals_ppm,
                driver_profile=drivers,
                extras=extras,
            ),
            out=out,
            log=log,
        )
        self.board.live.start(0, 0)
        self.now_ns = 0
        self.wait(10)

    def wait(self, dt_ms: int) -> None:
        """Let time pass, millisecond by millisecond or in longer strides."""
        end_ns = self.now_ns + dt_ms * _MS_IN_NS
        while self.now_ns < end_ns:
            self.now_ns = min(self.now_ns + self._stride_ms * _MS_IN_NS, end_ns)
            self.board.live.advance(self.now_ns)
            self._let_rotors_follow()
            if self.now_ns % _RECORD_EVERY_NS == 0:
                self.board.record_next()

    def _let_rotors_follow(self) -> None:
        simulation = self.board.live.simulation
        watch = simulation.rotor_watch
        for _ in range(self._pieces if watch else 0):
            if watch and watch.work_counts <= simulation.now_counts:
                watch.work()

    def send(self, *frames: Frame) -> None:
        """Send frames, one in a millisecond."""
        for frame in frames:
            self.board.live.send(frame, "a client", self.now_ns)
            self.wait(1)

    def move(self, sequence: int, wait_ms: int = 120) -> None:
        """Begin to move there and back by PVT, with a SYNC, and wait; the records are numbered from `sequence` on."""
        records = [record._replace(sequence=sequence + i) for i, record in enumerate(THERE_AND_BACK)]
        self.send(*enable(), *queue(*records), start_at_sync(), SYNC)
        self.wait(wait_ms)

    def end(self) -> None:
        """End the session; its files are complete."""
        self.board.record()
        self.board.close(self.board.report())
