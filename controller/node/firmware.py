"""The board's firmware as one object: up to eight axis nodes on one motion kernel.

`receive` processes a frame and `advance` advances time. Every call receives the time in 72 MHz counts since boot. The
caller fetches the results: frames by `transmit.take`, pin changes by `take_pins`, pulse edges by `motion.take_edges`.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, NamedTuple

from steptwin.controller.motion.axis_motion import AxisEvent
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.axis_context import BoardContext, BoardReadings
from steptwin.controller.node.axis_node import AxisNode
from steptwin.controller.node.lss_slave import BitTiming
from steptwin.controller.node.pins import OUTPUT_PINS, PinChange
from steptwin.controller.node.sync_clock import SyncClock
from steptwin.controller.node.transmit_queue import TransmitQueue
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import (
    COB_HEARTBEAT,
    COB_ID_MASK,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SYNC,
    COB_TIME,
    FIRST_NODE_ID,
    NODE_ID_MAX,
    REMOTE,
    Frame,
)
from steptwin.protocol.lss import COB_LSS_REQUEST
from steptwin.protocol.nmt import command_for
from steptwin.protocol.object_view import ObjectView
from steptwin.protocol.timer import COUNTS_PER_US

AXES_MAX: Final = 8
"""Axes of a board: an STM32F103 with CAN has two free 16-bit timers with four compare channels each."""

Handler = Callable[[bytes, int], None]


class FaultCause(NamedTuple):
    """An error for which an axis must stop."""

    code: ErrorCode
    detail: int


_EVENT_FAULTS = {AxisEvent.UNDERRUN: ErrorCode.PVT_UNDERRUN, AxisEvent.LATE_STEP: ErrorCode.LATE_STEP}


class Firmware:
    """Everything that runs on the board's microcontroller.

    The interpolating axes form one group. The group halts while bit 8 of the controlword is set for any axis in the
    mode interpolated position, in any state of its drive: the end or a fault of one axis does not let the others
    resume. Otherwise the group runs at the requested rate (2010h:03).
    """

    def __init__(
        self,
        kernel: Kernel,
        axis_count: int,
        flash: list[FlashPage] | None = None,
        first_node_id: int = FIRST_NODE_ID,
        view: ObjectView | None = None,
    ) -> None:
        """Power up.

        Args:
            kernel: functions that compute the motion.
            axis_count: number of axes, 1 to 8.
            flash: one page for each axis, read at boot and written when the host stores parameters.
            first_node_id: default node id of the first axis; the other axes have the next ids. LSS may change them.
            view: objects that the bus sees in place of those of `od`; None for these.

        Raises:
            ValueError: the number of axes or a node id is out of range.
        """
        if not 1 <= axis_count <= AXES_MAX:
            raise ValueError(f"a board has 1 to {AXES_MAX} axes, not {axis_count}")
        if not 1 <= first_node_id <= NODE_ID_MAX - axis_count + 1:
            raise ValueError(f"{axis_count} node ids from {first_node_id} on are not within 1 to {NODE_ID_MAX}")
        self.motion: BoardMotion = BoardMotion(kernel, axis_count)
        pages: list[FlashPage] = [FlashPage() for _ in range(axis_count)] if flash is None else flash
        self._measurements = BoardReadings()
        self._trips: dict[int, list[FaultCause]] = {}
        """Axes that request the fault reaction, with their errors."""
        self.transmit: TransmitQueue = TransmitQueue()
        """Frames that wait for a mailbox of the CAN controller."""
        self.bit_timing: BitTiming = BitTiming(pages)
        """Bit rate that the CAN controller must have."""
        self._inputs = [DigitalInput(0)] * axis_count
        factory_ids = range(first_node_id, first_node_id + axis_count)
        board = BoardContext(
            self.motion,
            self._measurements,
            SyncClock(),
            self.transmit,
            self._trip,
            list(factory_ids),
            self._inputs,
            self.bit_timing,
            view,
        )
        self.nodes: tuple[AxisNode, ...] = tuple(
            AxisNode(axis, factory_ids[axis], page, board) for axis, page in enumerate(pages)
        )
        self.dropped_frames: int = 0
        """Number of received frames whose COB-ID no node uses."""
        self.pins: list[PinChange] = []
        """Pin changes since the last `take_pins`."""
        self._routes: dict[int, list[tuple[AxisNode, Handler]]] = {}
        self._dues_us: list[int | None] = [None] * axis_count
        """Time of each node's next poll."""
        self.due_counts: int | None = None
        """Earliest next poll of any node, stored because a search at each small time step would be slow."""

    def boot(self, now_counts: int) -> None:
        """Boot: release the drivers from reset and announce the nodes."""
        for node in self.nodes:
            node.boot(now_counts // COUNTS_PER_US)
            self._fetch_from(node, now_counts)

    # --- frames in

    def receive(self, frame: Frame, now_counts: int) -> None:
        """Process one frame from the bus. No frame raises an exception, whatever its content."""
        cob_id, data = frame
        routes = self._routes.get(cob_id)
        if routes is not None:
            for node, handler in routes:
                handler(data, now_counts // COUNTS_PER_US)
                self._fetch_from(node, now_counts)
        elif cob_id == COB_NMT:
            for node in self.nodes:
                command = command_for(data, node.node_id)
                if command is not None:
                    node.on_nmt(command, now_counts // COUNTS_PER_US)
                    self._fetch_from(node, now_counts)
        else:
            self.dropped_frames += 1
        if self._trips or self.motion.group.must_ramp:
            self._end_call(now_counts)

    def hears(self, cob_id: int) -> bool:
        """Return whether the CAN controller's filters pass a COB-ID: NMT, SYNC, TIME, LSS or a service of the nodes.

        By default these are blocks of eight COB-IDs with one mask each. The 14 filter banks of bxCAN hold 28 masks or
        56 identifiers (RM0008, section 24.7.4).
        """
        return cob_id in self._routes or cob_id == COB_NMT

    def on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Report an error of the CAN controller, or its end, by an EMCY of every node.

        For a master each node is a device with its own error register (CiA 301, section 7.2.7). All nodes share the
        controller, and a lost frame may have been for any of them.
        """
        for node in self.nodes:
            node.on_can_error(code, now_counts // COUNTS_PER_US, active=active)
            self._fetch_from(node, now_counts)

    def on_bus_off(self, now_counts: int) -> None:
        """Let every node react to the bus-off of the CAN controller: all of them have lost their master."""
        for node in self.nodes:
            node.on_bus_off(now_counts // COUNTS_PER_US)
            self._fetch_from(node, now_counts)
        self._end_call(now_counts)

    def _route(self) -> None:
        """List the handlers of each COB-ID; called whenever a node's COB-IDs have changed."""
        self._routes = {
            COB_LSS_REQUEST: [(node, node.on_lss) for node in self.nodes],
            COB_SYNC: [(node, node.on_sync) for node in self.nodes],
            COB_TIME: [(node, node.on_time) for node in self.nodes],
        }
        for node in self.nodes:
            node.routes_changed = False
        nodes = [node for node in self.nodes if node.configured]
        for node in nodes:
            self._routes.setdefault(COB_SDO_REQUEST + node.node_id, []).append((node, node.on_sdo))
            self._routes.setdefault(REMOTE | COB_HEARTBEAT + node.node_id, []).append((node, node.on_guarding))
        for node in nodes:
            for number, pdo in enumerate(node.process_data.receive_pdos):
                if pdo.exists:
                    handler = partial(node.on_rpdo, number)
                    self._routes.setdefault(pdo.cob_id & COB_ID_MASK, []).append((node, handler))
            for producer_id in node.heartbeat_producers:
                handler = partial(node.on_heartbeat, producer_id)
                self._routes.setdefault(COB_HEARTBEAT + producer_id, []).append((node, handler))

    # --- inputs

    def set_inputs(self, inputs: Sequence[DigitalInput], now_counts: int) -> None:
        """Set the input levels of all axes at the start of the present servo tick."""
        self._inputs[:] = inputs
        for node, levels in zip(self.nodes, inputs, strict=True):
            with node.drive_at(now_counts // COUNTS_PER_US) as drive:
                drive.set_inputs(levels)
                drive.watch_other_switches()
            self._fetch_from(node, now_counts)
        self._end_call(now_counts)

    def measure(self, supply_10mv: int, temperature_decidegc: int, now_counts: int) -> None:
        """Set the readings of the board's analogue inputs."""
        self._measurements.supply_10mv = supply_10mv
        self._measurements.temperature_decidegc = temperature_decidegc
        for node in self.nodes:
            if node.drive.state is not State.NOT_READY_TO_SWITCH_ON:  # a board that is down checks nothing
                with node.drive_at(now_counts // COUNTS_PER_US) as drive:
                    drive.measured()
                self._fetch_from(node, now_counts)
        self._end_call(now_counts)

    # --- time forward

    def advance(self, until_counts: int) -> int:
        """Advance time to `until_counts`, or until the caller must act; return the instant reached.

        If that is earlier, frames or pin changes may be waiting, or the edges must be drained (`motion.room_ticks` is
        0).
        """
        motion = self.motion
        if not motion.events and motion.tick * TICK_COUNTS < until_counts:
            motion.advance(-(-until_counts // TICK_COUNTS))
        reached = motion.tick * TICK_COUNTS
        if reached <= until_counts and motion.events:
            self._handle_events(reached)
            return reached
        if reached < until_counts and motion.room_ticks == 0:
            return reached
        return until_counts

    def poll(self, now_counts: int) -> None:
        """Do the work of the nodes that is due by now."""
        if self.due_counts is not None and self.due_counts <= now_counts:
            now_us = now_counts // COUNTS_PER_US
            for node in self.nodes:
                if node.due_us is not None and node.due_us <= now_us:
                    node.poll(now_us)
                    self._fetch_from(node, now_counts)
            for node in self.nodes:
                if node.connection_loss is not None:
                    node.abort_connection(node.connection_loss, now_us)
                    self._fetch_from(node, now_counts)
        if self._trips:
            self._end_call(now_counts)

    @property
    def next_due_counts(self) -> int | None:
        """Next instant when the board has work without a frame or an input."""
        due_counts = self.due_counts
        if not self.motion.events:
            return due_counts
        event_counts = self.motion.tick * TICK_COUNTS
        return event_counts if due_counts is None else min(due_counts, event_counts)

    def _handle_events(self, now_counts: int) -> None:
        events = self.motion.take_events()
        now_us = now_counts // COUNTS_PER_US
        for axis, event in events:
            if event in _EVENT_FAULTS:
                self._trip(axis, _EVENT_FAULTS[event])
        self._stop_tripped(now_us)
        for axis, event in events:
            with self.nodes[axis].drive_at(now_us) as drive:
                if event is AxisEvent.FINISHED:
                    drive.finished()
        for node in self.nodes:
            self._fetch_from(node, now_counts)
        self._end_call(now_counts)

    def _end_call(self, now_counts: int) -> None:
        """End a call: stop the axes that have tripped, then change the group's rate."""
        group = self.motion.group
        if not (self._trips or group.must_ramp):
            return
        now_us = now_counts // COUNTS_PER_US
        self._stop_tripped(now_us)
        if group.must_ramp:
            self.motion.ramp_group([node.drive.stop.halt_deceleration() for node in self.nodes])
        for node in self.nodes:
            node.report_changes(now_us)
            self._fetch_from(node, now_counts)

    # --- faults

    def _trip(self, axis: int, code: ErrorCode, detail: int = 0) -> None:
        """Record an axis' request for the fault reaction (see `Trip`)."""
        self._trips.setdefault(axis, []).append(FaultCause(code, detail))

    def _stop_tripped(self, now_us: int) -> None:
        """Stop the axes that have tripped; if group stop (2010h:01) is set for one, stop its whole group.

        All axes ramp down in the same time, so the tool leaves the path along the tangent.
        """
        while self._trips:
            trips, self._trips = self._trips, {}
            stopping = {axis: faults for axis, faults in trips.items() if self.nodes[axis].drive.energised}
            if any(self.nodes[axis].dictionary.get(od.GROUP_STOP) for axis in stopping):
                for node in self.nodes:
                    if node.drive.mode.coordinated:
                        stopping.setdefault(node.axis, [FaultCause(ErrorCode.GROUP_STOPPED, 0)])
            stop_ms = max(
                (self.nodes[axis].drive.fault_stop_ms(*fault) for axis, faults in stopping.items() for fault in faults),
                default=0,
            )
            for axis, faults in stopping.items():
                with self.nodes[axis].drive_at(now_us) as drive:
                    for fault in faults:
                        drive.fault(*fault, stop_ms)

    # --- out

    def _fetch_from(self, node: AxisNode, now_counts: int) -> None:
        """Fetch a node's pin changes, its COB-IDs and the time of its next poll."""
        if node.routes_changed:
            self._route()
        if node.due_us != self._dues_us[node.axis]:
            self._dues_us[node.axis] = node.due_us
            dues_us = [due_us for due_us in self._dues_us if due_us is not None]
            self.due_counts = min(dues_us) * COUNTS_PER_US if dues_us else None
        if node.pins.changes:
            self._switch_pins(node, now_counts)

    def _switch_pins(self, node: AxisNode, now_counts: int) -> None:
        """Set the instants of a node's pin changes: a driver's pins wait for the end of the last pulse placed."""
        driver_counts = max(now_counts, self.motion.axes[node.axis].last_fall_counts)
        for pin, level in node.pins.changes:
            counts = now_counts if pin in OUTPUT_PINS else driver_counts
            self.pins.append(PinChange(counts, node.axis, pin, level))
        node.pins.changes.clear()

    def take_pins(self) -> list[PinChange]:
        """Return the pin changes since the last call, in order."""
        pins, self.pins = self.pins, []
        return pins
