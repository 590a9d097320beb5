"""Homing mode (CiA 402-2, "homing mode"): the axis looks for a switch and counts its position from there.

Bit 4 of the controlword, rising, starts it from standstill, with the objects as they are then: method 0x6098, speeds
0x6099, acceleration 0x609A, timeout 0x2020:01. The way to the edge is `switch_search`'s. When the axis stands behind
the edge, the step on which it was seen becomes the home offset 0x607C, to the nearest step. Methods 35 and 37 preset
the position of the standing axis to 0x607C, which is finer than a step: the demand may lie between two steps then.

All ramps are within 0x609A, but for a halt with 0x605D = 2. Soft limits do not count, nor are limit switches faults
while the mode itself moves the axis. An error stops the axis; the drive stays enabled and the position as it was. Bit
4, falling, aborts; halt interrupts, and its release begins anew from where the axis stands.

Bit 12 of the statusword comes with bit 10: "attained, but target not reached" does not occur, since masters that go on
at bit 12 would find the axis still moving, in coordinates that are about to change.
"""

from collections.abc import Callable
from enum import Enum, auto

from steptwin.controller.modes import Mode, Report
from steptwin.controller.motion import Motion
from steptwin.controller.profile import Limits
from steptwin.controller.profile_feed import ProfileFeed
from steptwin.controller.switch_search import Phase, SwitchSearch
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, DigitalInput, ErrorCode, HomingError, Status
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.homing_methods import HOMING_METHODS, HomingMethod
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS


class _State(Enum):
    IDLE = auto()
    """Not started, or aborted."""
    HALTED = auto()
    WAITING = auto()
    """For standstill, to begin."""
    SEARCHING = auto()
    DONE = auto()
    FAILED = auto()


class Homing(Mode):
    """The mode's handshake and result."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        feed: ProfileFeed,
        *,
        now_us: Callable[[], int],
        inputs: Callable[[], DigitalInput],
        discard_records: Callable[[], None],
        referenced: Callable[[], None],
        report: Report,
        resolved: Callable[[ErrorCode], None],
    ) -> None:
        super().__init__(axis, motion)
        self._dictionary = dictionary
        self._feed = feed
        self._now_us = now_us
        self._inputs = inputs
        self._discard_records = discard_records
        self._referenced = referenced
        self._report = report
        self._resolved = resolved
        self._state = _State.IDLE
        self._search: SwitchSearch | None = None
        """What is in progress in SEARCHING."""
        self._deadline_us: int | None = None

    # --- commands

    def control(self, controlword: int, previous: int) -> None:
        """Obey start and halt bits."""
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
        """Whether there is something to abort; once the edge is latched the axis comes to rest anyway."""
        latched = self._search is not None and self._search.phase is Phase.LATCHED
        return self._state is _State.WAITING or (self._state is _State.SEARCHING and not latched)

    def _start(self, *, halted: bool) -> None:
        self._clear_error()
        self._dictionary.set(od.HOMING_ERROR, HomingError.NONE)
        self._state = _State.HALTED if halted else _State.WAITING

    def _stop(self, *, halted: bool) -> None:
        self._search = self._deadline_us = None
        limits = self._limits(od.HOMING_SEARCH_SPEED)
        if self._feed.active and limits:
            (self._feed.halt if halted else self._feed.stop)(limits)

    def _begin(self) -> None:
        """Begin if a homing waits for that and the axis stands."""
        if self._state is not _State.WAITING or self._motion.running(self._axis):
            return
        method = HOMING_METHODS[self._dictionary.get(od.HOMING_METHOD)]
        if method is None:
            self._discard_records()
            self._motion.preset(self._axis, self._dictionary.get(od.HOME_OFFSET))
            self._attain()
        else:
            self._begin_search(method)

    def _begin_search(self, method: HomingMethod) -> None:
        fast, slow = self._limits(od.HOMING_SEARCH_SPEED), self._limits(od.HOMING_ZERO_SPEED)
        if fast is None or slow is None:
            self._fail(HomingError.NO_SPEED)
            return
        timeout_ms = self._dictionary.get(od.HOMING_TIMEOUT_MS)
        self._deadline_us = self._now_us() + 1000 * timeout_ms if timeout_ms else None
        self._state = _State.SEARCHING
        self._search = SwitchSearch(self._axis, self._motion, self._feed, method, fast, slow, self._inputs())
        self._search.begin()
        self._see()

    def _limits(self, speed: int) -> Limits | None:
        get = self._dictionary.get
        limits = self._feed.limits(get(speed) * VELOCITY_PER_UNIT_PER_MS // 1000)
        if limits is None:
            return None
        return limits._replace(
            acceleration=min(get(od.HOMING_ACCELERATION), get(od.MAX_ACCELERATION)),
            deceleration=min(get(od.HOMING_ACCELERATION), get(od.MAX_DECELERATION)),
        )

    # --- what comes of it

    def _see(self) -> None:
        """After anything that happened to the search: see whether it is over."""
        search = self._search
        if search is None:
            return
        if search.phase is Phase.DONE:
            self._motion.renumber(self._axis, search.latched_step, self._dictionary.get(od.HOME_OFFSET))
            self._attain()
        elif search.phase is Phase.FAILED:
            self._fail(search.error)

    def _attain(self) -> None:
        self._end(_State.DONE)
        self._referenced()

    def _fail(self, error: HomingError) -> None:
        self._end(_State.FAILED)
        self._dictionary.set(od.HOMING_ERROR, error)
        self._report(ErrorCode.HOMING_FAILED, error)

    def _end(self, state: _State) -> None:
        self._state = state
        self._search = self._deadline_us = None

    def _clear_error(self) -> None:
        if self._state is _State.FAILED:
            self._resolved(ErrorCode.HOMING_FAILED)

    def position_lost(self) -> None:
        """The axis is no longer where it was homed to be."""
        if self._state is _State.DONE:
            self._state = _State.IDLE

    # --- what happens

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """The axis' inputs have changed to these levels in the tick just over."""
        if self._search:
            self._search.inputs_changed(inputs)
            self._see()

    def finished(self) -> None:
        """The axis stands: at the end of a stroke or a ramp, be it the mode's own or not."""
        if not self._feed.finished():
            return
        if self._search:
            self._search.finished()
            self._see()
        self._begin()

    def interrupted(self) -> None:
        """The drive was stopped or switched off, or another mode takes over: what was done stays done."""
        self._feed.abandon()
        if self._state is not _State.DONE:
            self._clear_error()
            self._end(_State.IDLE)

    @property
    def due_us(self) -> int | None:
        """When the homing is to be over; the ramp behind the edge may take longer."""
        return self._deadline_us if self._seeking else None

    def poll(self, now_us: int) -> None:
        """See whether the homing takes too long."""
        if self.due_us is not None and self.due_us <= now_us and self._search:
            self._search.time_out()
            self._see()

    # --- what the mode says

    @property
    def seeks_switches(self) -> bool:
        """Whether the axis moves by the mode's own strokes and ramps."""
        return self._feed.active

    def target_reached(self) -> bool:
        """Bit 10: the axis stands, and not just to set off again."""
        return self._state not in (_State.WAITING, _State.SEARCHING) and super().target_reached()

    def status_bits(self) -> int:
        """Bits 12, homing attained, until the position is lost or another homing starts, and 13, homing error."""
        return {_State.DONE: Status.HOMING_ATTAINED, _State.FAILED: Status.HOMING_ERROR}.get(self._state, 0)
