"""Homing mode (CiA 402-2, "homing mode"): find the edge of a switch and define the position there.

A rising bit 4 of the controlword starts the homing from standstill with the present values of homing method (6098h),
speeds (6099h), acceleration (609Ah) and time-out (2020h:01). `switch_search` moves the axis to the edge. When the axis
is at standstill behind the edge, the step at which the edge was seen becomes the home offset (607Ch), to the nearest
step. Methods 35 and 37 set the position at standstill to exactly the home offset. Because a unit is finer than a step,
the demand may then be between two steps. Method 0 is attained at once and changes nothing.

Axes that move one joint together, such as the two motors of a CoreXY or of a gantry, are homed together: all start at
one SYNC. By 2020h:03 each monitors the switches of the same axis, so all see an edge in the same tick and each latches
its own counter. 2020h:03 to 05 are valid for the next homing only.

All ramps keep the homing acceleration, except a halt with the quick stop ramp (605Dh = 2). While the mode moves the
axis, soft limits do not apply and limit switches are not faults. An error stops the axis; the drive stays enabled and
the position stays valid. A falling bit 4 aborts the homing. Halt (bit 8) interrupts it; after the halt the homing
starts again from the present position.

Bits 12 and 10 of the statusword rise together. CiA 402 also has "attained, but target not reached". A master that
continues at bit 12 would then see the axis still move, and its coordinates change.
"""

from enum import Enum, auto

from steptwin.controller.modes.drive_mode import DriveMode
from steptwin.controller.modes.interpolation import Interpolation
from steptwin.controller.modes.profile import Limits
from steptwin.controller.modes.profile_feed import ProfileFeed
from steptwin.controller.modes.switch_search import Phase, Speeds, SwitchSearch
from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, DigitalInput, ErrorCode, HomingError, Status
from steptwin.protocol.homing_methods import HOMING_METHODS, NO_HOMING, HomingMethod
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError


class _State(Enum):
    IDLE = auto()
    """Not started, or aborted."""
    HALTED = auto()
    WAITING = auto()
    """Started; begins at standstill."""
    SEARCHING = auto()
    DONE = auto()
    FAILED = auto()


class Homing(DriveMode):
    """Controls homings and sets the position reference; `SwitchSearch` makes the motion."""

    def __init__(self, context: AxisContext, feed: ProfileFeed, records: Interpolation) -> None:
        super().__init__(context)
        self._feed = feed
        self._records = records
        self._state = _State.IDLE
        self._search: SwitchSearch | None = None
        """Search in progress while SEARCHING."""
        self._deadline_us: int | None = None
        self._switches_at: int | None = None
        """Axis whose switches are monitored in a homing of several axes; None for a homing of one axis."""
        self._reversed = self._partial = False
        context.dictionary.bind(self)

    def check_switch_node(self, node_id: int) -> None:
        """Refuse the node id of another board."""
        if node_id and node_id not in self._context.board.node_ids:
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    # --- commands

    def control(self, controlword: int, previous: int) -> None:
        """Obey the start and halt bits."""
        started, halted = bool(controlword & Control.START), bool(controlword & Control.HALT)
        if started and not previous & Control.START:
            self._start(halted=halted)
        elif self._state is _State.HALTED and not (started and halted):
            self._state = _State.WAITING if started else _State.IDLE
        elif self._seeking and not (started and not halted):
            self._state = _State.HALTED if started else _State.IDLE
            self._stop(halted=halted)
        self._begin()

    @property
    def _seeking(self) -> bool:
        """True while the homing can be aborted; after the latch of the edge the axis always finishes its stop."""
        latched = self._search is not None and self._search.phase is Phase.LATCHED
        return self._state is _State.WAITING or (self._state is _State.SEARCHING and not latched)

    def _start(self, *, halted: bool) -> None:
        self._clear_error()
        self._dictionary.set(od.HOMING_ERROR, HomingError.NONE)
        get = self._dictionary.get
        node_id = get(od.HOMING_SWITCH_NODE)
        self._switches_at = self._context.board.node_ids.index(node_id) if node_id else None
        self._reversed, self._partial = bool(get(od.HOMING_REVERSED)), bool(get(od.HOMING_PARTIAL))
        for address in (od.HOMING_SWITCH_NODE, od.HOMING_REVERSED, od.HOMING_PARTIAL):  # valid for one homing only
            self._dictionary.set(address, 0)
        self._state = _State.HALTED if halted else _State.WAITING

    def _stop(self, *, halted: bool) -> None:
        self._search = self._deadline_us = None
        limits = self._limits(od.HOMING_SEARCH_SPEED)
        if self._feed.active and limits:
            (self._feed.halt if halted else self._feed.stop)(limits)

    def _begin(self) -> None:
        """Begin a waiting homing at standstill."""
        if self._state is not _State.WAITING or self._motion.running:
            return
        number = self._dictionary.get(od.HOMING_METHOD)
        method = HOMING_METHODS.get(number)
        if number == NO_HOMING:
            self._partial = True  # the position reference stays as it is
            self._end(_State.DONE)
        elif method is None:
            self._records.discard()
            self._motion.preset(self._dictionary.get(od.HOME_OFFSET))
            self._attain()
        else:
            self._begin_search(method)

    def _begin_search(self, method: HomingMethod) -> None:
        fast, slow = self._limits(od.HOMING_SEARCH_SPEED), self._limits(od.HOMING_ZERO_SPEED)
        if fast is None or slow is None:
            self._fail(HomingError.NO_SPEED)
            return
        timeout_ms = self._dictionary.get(od.HOMING_TIMEOUT_MS)
        self._deadline_us = self._context.now_us + 1000 * timeout_ms if timeout_ms else None
        self._state = _State.SEARCHING
        inputs = self._context.board.inputs[self.switches_at]
        sign = -1 if self._reversed else 1
        self._search = SwitchSearch(self._context, self._feed, method, Speeds(fast, slow, sign), inputs)
        self._search.begin()
        self._conclude()

    def _limits(self, speed: int) -> Limits | None:
        get = self._dictionary.get
        limits = self._feed.limits(get(speed) * VELOCITY_PER_UNIT_PER_MS // 1000)
        if limits is None:
            return None
        return limits._replace(
            acceleration=min(get(od.HOMING_ACCELERATION), get(od.MAX_ACCELERATION)),
            deceleration=min(get(od.HOMING_ACCELERATION), get(od.MAX_DECELERATION)),
        )

    # --- results

    def _conclude(self) -> None:
        """End the homing if its search is over; called after every event of the search."""
        search = self._search
        if search is None:
            return
        if search.phase is Phase.DONE:
            self._motion.renumber(search.latched_step, self._dictionary.get(od.HOME_OFFSET))
            self._attain()
        elif search.phase is Phase.FAILED:
            self._fail(search.error)

    def _attain(self) -> None:
        self._end(_State.DONE)
        if self._partial:
            self._context.reference.lose()
        else:
            self._context.reference.set()

    def _fail(self, error: HomingError) -> None:
        self._end(_State.FAILED)
        self._dictionary.set(od.HOMING_ERROR, error)
        self._context.errors.report(ErrorCode.HOMING_FAILED, error)

    def _end(self, state: _State) -> None:
        self._state = state
        self._search = self._deadline_us = None

    def _clear_error(self) -> None:
        if self._state is _State.FAILED:
            self._context.errors.resolved(ErrorCode.HOMING_FAILED)

    # --- events

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """Handle new input levels, read at the end of the last tick."""
        if self._search:
            self._search.inputs_changed(inputs)
            self._conclude()

    def finished(self) -> None:
        """Handle standstill after any motion."""
        if not self._feed.finished():
            return
        if self._search:
            self._search.finished()
            self._conclude()
        self._begin()

    def interrupted(self) -> None:
        """Abort a homing in progress, because the drive stops or changes its mode. A finished homing stays valid."""
        self._feed.abandon()
        if self._state is not _State.DONE:
            self._clear_error()
            self._end(_State.IDLE)

    @property
    def due_us(self) -> int | None:
        """Instant of the homing's time-out; the ramp behind the edge may take longer."""
        return self._deadline_us if self._seeking else None

    def poll(self, now_us: int) -> None:
        """Fail the homing if it has timed out."""
        if self.due_us is not None and self.due_us <= now_us and self._search:
            self._search.time_out()
            self._conclude()

    # --- status

    @property
    def switches_at(self) -> int:
        """Axis whose inputs have the switches."""
        return self._context.axis if self._switches_at is None else self._switches_at

    @property
    def coordinated(self) -> bool:
        """True while a homing of several axes moves this axis."""
        return self._switches_at is not None and self._feed.active

    @property
    def seeks_switches(self) -> bool:
        """True while the mode itself moves the axis."""
        return self._feed.active

    def target_reached(self) -> bool:
        """Return bit 10: the axis is at standstill, and no homing waits or is between two strokes."""
        return self._state not in (_State.WAITING, _State.SEARCHING) and super().target_reached()

    def status_bits(self) -> int:
        """Return bits 12 and 13: homing attained (until the reference is lost or a homing starts), homing error."""
        if self._state is _State.FAILED:
            return Status.HOMING_ERROR
        attained = self._state is _State.DONE and (self._partial or self._context.reference.known)
        return Status.HOMING_ATTAINED if attained else 0
