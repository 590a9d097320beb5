"""StepTwin's firmware as the program of an emulated board, and its connections to the emulator.

Beside pins and frames, the emulator receives the records that an axis accepts and the ramps of the group's time rate.
It supplies the entries of the object dictionary that only an emulator can know.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import RateRamp
from steptwin.controller.node.firmware import Firmware
from steptwin.protocol import od
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board

_DRIVER_ENTRIES = od.ROTOR_POSITION_STEPS, od.LOST_STEPS, od.DRIVER_VIOLATIONS, od.DRIVER_MICROSTEPS
"""Entries in the order of DriverMonitor's fields."""
_ROTOR_ENTRIES = od.SHAFT_POSITION, od.SLIPPED_FULL_STEPS
"""Entries in the order of Shaft's fields."""


class OwnProgram:
    """StepTwin's firmware and its stored parameters.

    Attributes:
        flash: stored parameters, one page for each axis.
        firmware: firmware since the last power-up.
        rate_ramps: ramps of the group's time rate, since power-up or since they were last taken.
    """

    def __init__(self, kernel: Kernel, axis_count: int, flash: list[FlashPage] | None = None) -> None:
        """Create the program; `flash` holds parameters that were stored before, None for a new board."""
        self.flash: list[FlashPage] = [FlashPage() for _ in range(axis_count)] if flash is None else flash
        self.rate_ramps: list[RateRamp] = []
        self._kernel = kernel
        self._on_record: dict[int, Callable[[PvtRecord], None]] = {}
        """By axis, listener to the records that its queue accepts."""

    def start(self, board: "Board") -> Firmware:
        """Return a new firmware with the stored parameters."""
        config = board.config
        self.firmware: Firmware = Firmware(
            self._kernel, config.axis_count, self.flash, config.first_node_id, config.view
        )
        self.firmware.motion.group.on_ramp = self._note_ramp
        return self.firmware

    def connect(self, board: "Board") -> None:
        """Connect the firmware's dictionary to the board's drivers, and the listeners to the firmware."""
        for axis, listener in self._on_record.items():
            self.on_record(board, axis, listener)
        timing, can = self.firmware.bit_timing, board.can
        can.bitrate = timing.bitrate
        timing.on_change = lambda: can.fall_silent() if timing.silent else can.tune(timing.bitrate)
        for axis, node in enumerate(self.firmware.nodes):
            node.dictionary.bind(EmulatedAxis(board, axis))

    def _note_ramp(self, ramp: RateRamp) -> None:
        self.rate_ramps.append(ramp)

    def take_rate_ramps(self) -> list[RateRamp]:
        """Return `rate_ramps` up to now and clear it."""
        ramps, self.rate_ramps = self.rate_ramps, []
        return ramps

    def on_record(self, board: "Board", axis: int, listener: Callable[[PvtRecord], None]) -> None:
        """Call a listener with each PVT record that an axis' queue accepts from now on."""
        self._on_record[axis] = listener
        self.firmware.nodes[axis].drive.interpolation.taken = []
        board.can.receive = self._receive_and_tell

    def _receive_and_tell(self, frame: Frame, now_counts: int) -> None:
        """Pass a frame to the firmware, then accepted records to the listeners."""
        self.firmware.receive(frame, now_counts)
        for axis, listener in self._on_record.items():
            records = self.firmware.nodes[axis].drive.interpolation
            taken, records.taken = records.taken, []
            for record in taken or ():
                listener(record)


class EmulatedAxis:
    """Entries of one axis that only an emulator can supply (2F00h): counts of its driver, and its rotor."""

    def __init__(self, board: "Board", axis: int) -> None:
        self._board = board
        self._axis = axis
        self._before = board.driver_counts(axis)._replace(microsteps=0)

    def count_at(self, address: int) -> int:
        """Return a count of the driver since power-up, or the driver's present mode."""
        i = _DRIVER_ENTRIES.index(address)
        return self._board.driver_counts(self._axis)[i] - self._before[i]

    def rotor_at(self, address: int) -> int:
        """Return the rotor's position, or the full steps by which it has slipped."""
        return self._board.shaft(self._axis)[_ROTOR_ENTRIES.index(address)]
