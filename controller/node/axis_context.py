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
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pdo import ProcessData


@dataclass(slots=True)
class BoardReadings:
    """Readings that all axes of the board share; nominal values until the first measurement."""

    supply_10mv: int = 2400
    temperature_decidegc: int = 250

    @property
    def supply_mv(self) -> int:
        """The same supply as CiA 402 has it, object 6079h: a stepper board's DC link is its motor supply."""
        return 10 * self.supply_10mv


class PositionReference:
    """The position reference of one axis: set by homing, lost when the driver is cut off in motion.

    The steps that the driver has lost stand in object 2F00h, which only the emulated board supplies. A real board
    without encoder counts every step as made, and its following error is then the rounding to steps.
    """

    def __init__(self, motion: AxisMotion, dictionary: ObjectDictionary) -> None:
        self._motion = motion
        self._lost_steps = dictionary.cell(od.LOST_STEPS)
        self._lost_before_steps = 0
        """Steps lost before the reference was set last: they do not count."""
        self.known: bool = False
        """True from a homing on, until the axis may have moved without counting."""
        dictionary.bind(self)

    def set(self) -> None:
        """Note that homing has set the position: the rotor is where the counter says."""
        self.known = True
        self._lost_before_steps = self._lost_steps.get()

    def lose(self) -> None:
        """Note that the rotor may have moved without the counter."""
        self.known = False

    @property
    def lost_units(self) -> int:
        """Distance of the rotor behind the step counter, as far as it has grown since the reference was set."""
        lost_steps = self._lost_steps.get() - self._lost_before_steps
        return lost_steps * UNITS_PER_FULL_STEP // self._motion.config.microsteps

    @property
    def following_error_units(self) -> int:
        """Demanded position less the position that the driver has counted."""
        return self._motion.demand_units - self._motion.counter_units + self.lost_units


class Trip(Protocol):
    """Request the fault reaction of an axis, and of its group if the fault stops the group.

    The reaction begins after the caller has returned, so that faults of the same instant are handled together.
    """

    def __call__(self, axis: int, code: ErrorCode, detail: int = 0) -> None: ...


class BoardContext(NamedTuple):
    """Motion, measurements, clocks, inputs and CAN driver of the board, and the way to request a fault reaction."""

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


class AxisContext:
    """One axis' dictionary, process data, errors, pins, limits and reference; the time of the call being served."""

    def __init__(self, axis: int, node_id: int, flash_page: FlashPage, board: BoardContext) -> None:
        self.axis = axis
        self.board = board
        self.motion: AxisMotion = board.motion.axes[axis]
        self.dictionary: ObjectDictionary = ObjectDictionary(node_id, stored=flash_page)
        self.process_data: ProcessData = ProcessData(self.dictionary)
        self.heartbeats: HeartbeatConsumer = HeartbeatConsumer(self.dictionary)
        self.errors: AxisErrors = AxisErrors(self.dictionary, self.heartbeats, self.touch)
        self.pins: AxisPins = AxisPins()
        self.limits: SoftLimits = SoftLimits(self.dictionary)
        self.reference: PositionReference = PositionReference(self.motion, self.dictionary)
        self.dictionary.bind(board.measurements)
        self.dictionary.bind(self.motion)
        self.now_us = 0
        """Time of the call being served."""
        self.touched: bool = False
        """True once the call being served has changed anything that the node may have to send."""

    def touch(self) -> None:
        """Make the node look for frames to send when the call being served ends."""
        self.touched = True

    def changed(self, address: int) -> None:
        """Note that the value of an entry has changed: event-driven TPDOs report it."""
        self.touched = True
        self.process_data.changed(address)

    def trip(self, code: ErrorCode, detail: int = 0) -> None:
        """Request this axis' fault reaction (see `Trip`)."""
        self.board.trip(self.axis, code, detail)
