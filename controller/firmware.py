"""The board's firmware as one object: up to eight axis nodes on one motion kernel.

`receive` takes a frame, `advance` lets time pass; both are told the time in 72 MHz counts since boot. What comes out
is fetched: frames by `take_frames`, pin changes by `take_pins`, pulse edges by `motion.take_edges`.
"""

from collections.abc import Callable
from enum import Enum
from functools import partial
from typing import NamedTuple

from controller.axis_node import AxisNode
from controller.backend import Kernel
from controller.kernel import TICK_COUNTS
from controller.motion import COUNTS_PER_US, Event, Motion
from protocol.cia402 import DigitalOutput, ErrorCode
from protocol.dictionary import FlashPage
from protocol.frame import (
    COB_HEARTBEAT,
    COB_ID_MASK,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SYNC,
    FIRST_NODE_ID,
    NODE_ID_MAX,
    Frame,
)
from protocol.nmt import command_for

AXES_MAX = 8
"""Two 16-bit timers with four compare channels each, on an STM32F103 with CAN in use."""

Handler = Callable[[bytes, int], None]


class Pin(Enum):
    """The pins that the firmware holds at a level: driver inputs and the axis' outputs; CLK and DIR come as edges."""

    RESET = "RESET"
    ENABLE = "ENABLE"
    OUT1 = "OUT1"
    OUT2 = "OUT2"


OUTPUT_PINS = {Pin.OUT1: DigitalOutput.OUT1, Pin.OUT2: DigitalOutput.OUT2}
"""The pins that follow object 0x60FE, with their bits in it."""


class PinChange(NamedTuple):
    """A pin of one axis takes a level."""

    counts: int
    axis: int
    pin: Pin
    level: int


class Firmware:
    """Everything that runs on the board's microcontroller.

    The axes that interpolate are one group. It is halted while bit 8 is set in the controlword of any axis whose mode
    is interpolated position, whatever that axis' drive does: neither its end nor its fault sets the others going.
    """

    def __init__(
        self,
        kernel: Kernel,
        axis_count: int,
        flash: list[FlashPage] | None = None,
        first_node_id: int = FIRST_NODE_ID,
    ) -> None:
        """Set the board up.

        Args:
            kernel: what computes the motion.
            axis_count: 1 to 8.
            flash: a page for each axis, which is read at boot and written when the host stores parameters.
            first_node_id: the first axis' node id; the others count on from it.
        """
        if not 1 <= axis_count <= AXES_MAX:
            raise ValueError(f"a board has 1 to {AXES_MAX} axes, not {axis_count}")
        if not 1 <= first_node_id <= NODE_ID_MAX - axis_count + 1:
            raise ValueError(f"{axis_count} node ids from {first_node_id} on are not within 1 to {NODE_ID_MAX}")
        self.motion = Motion(kernel, axis_count)
        pages: list[FlashPage] = [{} for _ in range(axis_count)] if flash is None else flash
        self.nodes = tuple(AxisNode(first_node_id + axis, axis, self.motion, page) for axis, page in enumerate(pages))
        self.dropped_frames = 0
        """Frames that were for nobody here or malformed."""
        self._frames: list[Frame] = []
        self._pins: list[PinChange] = []
        self._energised = [False] * axis_count
        self._outputs = [0] * axis_count
        self._routes: dict[int, list[tuple[AxisNode, Handler]]] = {}

    def boot(self, now_counts: int) -> None:
        """Power-up: release the drivers from reset, announce the nodes."""
        for node in self.nodes:
            self._pins.append(PinChange(now_counts, node.axis, Pin.RESET, 1))
            node.boot(now_counts // COUNTS_PER_US)
            self._collect(node, now_counts)

    # --- frames in

    def receive(self, frame: Frame, now_counts: int) -> None:
        """Take one frame from the bus; whatever it holds, it never raises."""
        self._deliver(frame, now_counts)
        self._tend_halt(now_counts)

    def _deliver(self, frame: Frame, now_counts: int) -> None:
        now_us = now_counts // COUNTS_PER_US
        if frame.cob_id == COB_NMT:
            self._on_nmt(frame.data, now_counts)
            return
        if frame.cob_id == COB_SYNC:
            for node in self.nodes:
                node.on_sync(frame.data, now_us)
                self._collect(node, now_counts)
            return
        listeners = self._routes.get(frame.cob_id)
        if listeners is None:
            self.dropped_frames += 1
            return
        for node, handler in listeners:
            handler(frame.data, now_us)
            self._collect(node, now_counts)

    def hears(self, cob_id: int) -> bool:
        """What the CAN controller's filters are set to: NMT, SYNC and what the nodes' communication parameters say.

        By default these are blocks of eight, with a mask each; bxCAN's 14 filter banks hold 28 masks or 56 identifiers
        (RM0008, section 24.7.4).
        """
        return cob_id in self._routes or cob_id in (COB_NMT, COB_SYNC)

    def on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Report that an error of the CAN controller has occurred, or that it is over: one EMCY of every node.

        To a master each node is a device of its own, with its own error register (CiA 301, section 7.2.7); all of them
        lost the same bus, and nobody knows to which of them a lost message would have gone.
        """
        for node in self.nodes:
            node.on_can_error(code, now_counts // COUNTS_PER_US, active=active)
            self._collect(node, now_counts)

    def _on_nmt(self, data: bytes, now_counts: int) -> None:
        for node in self.nodes:
            command = command_for(data, node.node_id)
            if command is not None:
                node.on_nmt(command, now_counts // COUNTS_PER_US)
                self._collect(node, now_counts)

    def _route(self) -> None:
        """Which node's which service takes a COB-ID; made anew when a node's PDO parameters change."""
        self._routes = {}
        for node in self.nodes:
            node.routes_changed = False
            self._routes[COB_SDO_REQUEST + node.node_id] = [(node, node.on_sdo)]
        for node in self.nodes:
            for number, pdo in enumerate(node.process_data.receive_pdos):
                if pdo.exists:
                    handler = _rpdo_handler(node, number)
                    self._routes.setdefault(pdo.cob_id & COB_ID_MASK, []).append((node, handler))
            for producer_id in node.heartbeat_producers:
                handler = partial(node.on_heartbeat, producer_id)
                self._routes.setdefault(COB_HEARTBEAT + producer_id, []).append((node, handler))

    # --- time forward

    def advance(self, until_counts: int) -> int:
        """Let time pass; return the instant reached, `until_counts` unless something came out before it.

        Before that, either frames or pins are waiting to be fetched, or the edges need draining
        (`motion.room_ticks` is 0).
        """
        until_tick = -(-until_counts // TICK_COUNTS)
        if not self.motion.has_events and self.motion.tick < until_tick:
            self.motion.advance(until_tick)
        reached = self.motion.tick * TICK_COUNTS
        if self.motion.has_events and reached <= until_counts:
            self._handle_events(reached)
            return reached
        if self.motion.room_ticks == 0:
            return min(reached, until_counts)
        return until_counts

    def poll(self, now_counts: int) -> None:
        """Send whatever is due by now."""
        now_us = now_counts // COUNTS_PER_US
        for node in self.nodes:
            if node.due_us is not None and node.due_us <= now_us:
                node.poll(now_us)
                self._collect(node, now_counts)
        if any(node.connection_lost for node in self.nodes):
            self._abort_connections(now_counts)

    @property
    def next_due_counts(self) -> int | None:
        """The next instant at which something happens on the board by itself, as far as it is known."""
        dues = [node.due_us * COUNTS_PER_US for node in self.nodes if node.due_us is not None]
        if self.motion.has_events:
            dues.append(self.motion.tick * TICK_COUNTS)
        return min(dues, default=None)

    def _handle_events(self, now_counts: int) -> None:
        events = self.motion.take_events()
        now_us = now_counts // COUNTS_PER_US
        faults = {
            axis: ErrorCode.PVT_UNDERRUN if event is Event.UNDERRUN else ErrorCode.LATE_STEP
            for axis, event in events
            if event in (Event.UNDERRUN, Event.LATE_STEP)
        }
        if faults:
            self._stop_group(faults, now_us)
        for axis, event in events:
            if event is Event.FINISHED:
                self.nodes[axis].finished(now_us)
            elif event is Event.HALTED:
                self.nodes[axis].time_scaled(now_us)
        for node in self.nodes:
            self._collect(node, now_counts)
        self._tend_halt(now_counts)

    def _tend_halt(self, now_counts: int) -> None:
        """Halt the group or let it go on, if that is asked for after all that one frame or instant has changed."""
        group = self.motion.group
        if group.halted == group.halt_wanted:
            return
        self.motion.ramp_group([node.dictionary.get(0x6085) for node in self.nodes])
        for node in self.nodes:
            node.time_scaled(now_counts // COUNTS_PER_US)
            self._collect(node, now_counts)

    def _abort_connections(self, now_counts: int) -> None:
        """Let the axes that have lost their host react, those with a fault together with their group."""
        now_us = now_counts // COUNTS_PER_US
        lost = [node for node in self.nodes if node.connection_lost]
        for node in lost:
            node.abort_connection(now_us)
        faults = {node.axis: ErrorCode.HEARTBEAT_LOST for node in lost if node.signals_lost_connection}
        if faults:
            self._stop_group(faults, now_us)
        for node in self.nodes:
            self._collect(node, now_counts)

    def _stop_group(self, faults: dict[int, ErrorCode], now_us: int) -> None:
        """Stop the faulty axes and, where a faulty axis asks for it, all that interpolate with it, in the same time.

        Equal duration makes the tool leave the path along its tangent instead of turning away from it.
        """
        stopping = dict(faults)
        if any(self.nodes[axis].dictionary.get(0x2010, 1) for axis in faults):
            for node in self.nodes:
                if node.interpolation.running:
                    stopping.setdefault(node.axis, ErrorCode.GROUP_STOPPED)
        stop_ms = max(self.nodes[axis].stop_ms() for axis in stopping)
        for axis, code in stopping.items():
            self.nodes[axis].fault(code, stop_ms, now_us)

    # --- out

    def _collect(self, node: AxisNode, now_counts: int) -> None:
        """Fetch what a node has to say, show its state and outputs on their pins, follow its COB-IDs."""
        if node.routes_changed:
            self._route()
        if node.outbox:
            self._frames += node.outbox
            node.outbox.clear()
        if node.energised is not self._energised[node.axis]:
            self._energised[node.axis] = node.energised
            self._pins.append(PinChange(now_counts, node.axis, Pin.ENABLE, int(node.energised)))
        if node.outputs != self._outputs[node.axis]:
            self._switch_outputs(node, now_counts)

    def _switch_outputs(self, node: AxisNode, now_counts: int) -> None:
        changed = node.outputs ^ self._outputs[node.axis]
        self._outputs[node.axis] = node.outputs
        for pin, bit in OUTPUT_PINS.items():
            if changed & bit:
                self._pins.append(PinChange(now_counts, node.axis, pin, int(bool(node.outputs & bit))))

    def take_frames(self) -> list[Frame]:
        """Return the frames that want to be sent now."""
        frames, self._frames = self._frames, []
        return frames

    def take_pins(self) -> list[PinChange]:
        """Return the pin changes since the last call, in order."""
        pins, self._pins = self._pins, []
        return pins


def _rpdo_handler(node: AxisNode, number: int) -> Handler:
    return lambda data, now_us: node.on_rpdo(number, data, now_us)
