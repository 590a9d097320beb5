"""The parts of an axis that its node, its drive and its modes of operation share."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from steptwin.controller.motion.axis_motion import AxisMotion
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.node.axis_errors import AxisErrors
from steptwin.controller.node.lss_slave import BitTiming
from steptwin.controller.node.pins import AxisPins
from steptwin.controller.node.soft_limits import SoftLimits
from steptwin.controller.node.sync_clock import SyncClock
from steptwin.controller.node.transmit_queue import TransmitQueue
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.dictionary import FlashPage, ObjectDictionary
from steptwin.protocol.heartbeat_consumer import HeartbeatConsumer
from steptwin.protocol.object_view import ObjectView
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pdo import ProcessData


@dataclass(slots=True)
class BoardReadings:
    """Readings that all axes of the board share; nominal values until the first measurement."""

    supply_10mv: int = 2400
    temperature_decidegc: int = 250

    @property
    def supply_mv(self) -> int:
        """The supply in mV for CiA 402's object 6079h: the DC link of a stepper board is its motor supply."""
        return 10 * self.supply_10mv


class PositionReference:
    """The position reference of one axis: set by homing, lost when the driver is cut off in motion.

    Object 2F00h holds the steps that the driver has lost; only the emulated board supplies it. A real board without
    encoder assumes that every step was made, so its following error is only the rounding to steps.
    """

    def __init__(self, motion: AxisMotion, dictionary: ObjectDictionary) -> None:
        self._motion = motion
        self._lost_steps = dictionary.cell(od.LOST_STEPS)
        self._lost_before_steps = 0
        """Steps lost before the last homing; they do not count."""
        self.known: bool = False
        """True after a homing, until the axis may have moved without being counted."""
        dictionary.bind(self)

    def set(self) -> None:
        """Set the reference: homing has set the counter to the rotor's position."""
        self.known = True
        self._lost_before_steps = self._lost_steps.get()

    def lose(self) -> None:
        """Lose the reference: the rotor may have moved without being counted."""
        self.known = False

    @property
    def lost_units(self) -> int:
        """Distance in units that the rotor has fallen behind the step counter since the reference was set."""
        lost_steps = self._lost_steps.get() - self._lost_before_steps
        return lost_steps * UNITS_PER_FULL_STEP // self._motion.config.microsteps

    @property
    def following_error_units(self) -> int:
        """Demanded position minus the position that the driver has counted."""
        return self._motion.demand_units - self._motion.counter_units + self.lost_units


class Trip(Protocol):
    """Request the fault reaction of an axis, and of its group if the fault stops the group.

    The reaction begins after the caller returns, so faults of the same instant are handled together.
    """

    def __call__(self, axis: int, code: ErrorCode, detail: int = 0) -> None: ...


class BoardContext(NamedTuple):
    """Parts of the board that all its axes share, and the function that requests a fault reaction."""

    motion: BoardMotion
    measurements: BoardReadings
    sync_clock: SyncClock
    transmit: TransmitQueue
    trip: Trip
    node_ids: list[int]
    """Present node ids of all axes."""
    inputs: list[DigitalInput]
    """Present input levels of all axes."""
    bit_timing: BitTiming
    view: ObjectView | None
    """Objects that the bus sees in place of the firmware's own."""


class AxisContext:
    """The parts of one axis that its node, drive and modes share, and the time of the present call."""

    def __init__(self, axis: int, node_id: int, flash_page: FlashPage, board: BoardContext) -> None:
        self.axis = axis
        self.board = board
        self.motion: AxisMotion = board.motion.axes[axis]
        self.dictionary: ObjectDictionary = ObjectDictionary(node_id, stored=flash_page, view=board.view)
        self.process_data: ProcessData = ProcessData(self.dictionary)
        self.heartbeats: HeartbeatConsumer = HeartbeatConsumer(self.dictionary)
        self.errors: AxisErrors = AxisErrors(self.dictionary, self.heartbeats, self.touch)
        self.pins: AxisPins = AxisPins()
        self.limits: SoftLimits = SoftLimits(self.dictionary)
        self.reference: PositionReference = PositionReference(self.motion, self.dictionary)
        self.dictionary.bind(board.measurements)
        self.dictionary.bind(self.motion)
        self.now_us = 0
        """Time of the present call."""
        self.touched: bool = False
        """True if the present call has changed something that the node may have to send."""

    def touch(self) -> None:
        """Make the node check for frames to send at the end of the present call."""
        self.touched = True

    def changed(self, address: int) -> None:
        """Announce a changed entry to the event-driven TPDOs."""
        self.touched = True
        self.process_data.changed(address)

    def trip(self, code: ErrorCode, detail: int = 0) -> None:
        """Request this axis' fault reaction (see `Trip`)."""
        self.board.trip(self.axis, code, detail)
