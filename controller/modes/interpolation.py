"""Interpolated position mode: queue PVT records in the order of their sequence numbers; run them as cubic segments.

A queue that is stopped before its end is closed. It accepts no record until the host clears it (buffer clear,
60C4h:06): frames that are still in transit cannot move the axis again.

A record consists of four entries (60C1h:01 to :04), as CiA 402's interpolation data record. Any CANopen master can map
it into a PDO or write it by SDO. A write of the last entry, the sequence number, queues the record; the other three are
read from their cells.
"""

from steptwin.controller.modes.drive_mode import DriveMode
from steptwin.controller.motion.axis_motion import Refusal
from steptwin.controller.motion.kernel import FULL_RATE_Q16, I32_MAX, TICKS_PER_MS
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.soft_limits import hull
from steptwin.controller.node.stops import AxisStop, StopKind
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, ErrorCode, Status
from steptwin.protocol.pvt import QUEUE_DEPTH, SEQUENCE_MODULUS, PvtFlag, PvtRecord, Verdict, judge
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_STICKY = {Verdict.GAP: PvtFlag.GAP, Verdict.FULL: PvtFlag.OVERFLOW}


class Interpolation(DriveMode):
    """The bus side of one axis' PVT queue: flow control, PVT status (2012h) and PVT counters (2013h)."""

    def __init__(self, context: AxisContext, stop: AxisStop) -> None:
        super().__init__(context)
        self._errors = context.errors
        self._stop = stop
        self._group = context.board.motion.group
        self.next_sequence: int = 0
        """Expected sequence number of the next record."""
        self._sticky = 0
        """Flags that stay set until they are cleared."""
        self._running = False
        self._closed = False
        self.ready = False
        """True while the drive is enabled in this mode; a queue with records is then armed."""
        self.taken: list[PvtRecord] | None = None
        """Records accepted since the board last fetched them; None if it fetches none."""
        dictionary = context.dictionary
        dictionary.bind(self)
        self._limits = context.limits
        self._displacement_units = dictionary.cell(od.PVT_DISPLACEMENT)
        self._end_velocity = dictionary.cell(od.PVT_END_VELOCITY)
        self._duration_ms = dictionary.cell(od.PVT_DURATION_MS)
        self._least_fill = dictionary.cell(od.PVT_LEAST_FILL)
        self._accepted = dictionary.cell(od.PVT_ACCEPTED)

    # --- records in

    def take_record(self, sequence: int) -> None:
        """Queue the record whose sequence number is written now; its other fields have been written before."""
        queued = self._motion.queued
        verdict = judge(sequence, self.next_sequence, 0 if self._closed else QUEUE_DEPTH - queued)
        if verdict is Verdict.STALE:
            return
        if verdict is not Verdict.PUSH:
            self._drop(verdict)
            return
        if self._running and queued < self._least_fill.value:
            self._least_fill.value = queued
        units, velocity, duration_ms = self._displacement_units.value, self._end_velocity.value, self._duration_ms.value
        refusal = self._push(units, velocity, duration_ms)
        if refusal is not Refusal.ACCEPTED:
            self._reject(sequence, refusal)
            return
        self.next_sequence = (sequence + 1) % SEQUENCE_MODULUS
        if self._sticky:
            self._sticky &= ~(PvtFlag.GAP | PvtFlag.OVERFLOW)
        self._accepted.count()
        if self.taken is not None:
            self.taken.append(PvtRecord(units, velocity, duration_ms, sequence))

    def _push(self, displacement_units: int, end_velocity: int, duration_ms: int) -> Refusal:
        """Queue a segment, unless it leaves the soft limits; from beyond a limit it may only return."""
        low, high = self._limits.range()
        if low > -I32_MAX or high < I32_MAX:
            start, velocity = self._motion.tail_units, self._motion.tail_velocity
            least, most = hull(start, velocity, displacement_units, end_velocity, duration_ms)
            if least < min(low, start) or most > max(high, start):
                return Refusal.SOFT_LIMIT
        return self._motion.push_record(displacement_units, end_velocity, duration_ms * TICKS_PER_MS)

    def _drop(self, verdict: Verdict) -> None:
        """Count and flag a gap or an overflow; report only the first one, so that bad records cannot flood the bus."""
        flag = _STICKY[verdict]
        self._dictionary.cell(od.PVT_GAPS if verdict is Verdict.GAP else od.PVT_OVERFLOWS).count()
        if not self._sticky & flag:
            self._sticky |= flag
            self._flags_changed()

    def _reject(self, sequence: int, refusal: Refusal) -> None:
        self._sticky |= PvtFlag.REJECTED
        self._errors.report(ErrorCode.SEGMENT_REFUSED, refusal << 8 | sequence)
        self._flags_changed()
        raise SdoAbortError(AbortCode.VALUE_RANGE)

    def clear(self, value: int) -> None:
        """Empty the queue if 0 is written, and expect sequence number 0 next; refuse while the axis moves."""
        if value:
            return
        if self._motion.running:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self._motion.flush()
        self.restart()

    def restart(self) -> None:
        """Expect sequence number 0, clear the flags, open the queue and limit its rate to full rate."""
        self.next_sequence = 0
        self._sticky = 0
        self._errors.resolved(ErrorCode.SEGMENT_REFUSED)
        self.finished()
        self._closed = False
        self._motion.highest_rate_q16 = FULL_RATE_Q16

    # --- the rate of the group's time

    def wanted_rate(self) -> int:
        """Return the requested rate of the group's time in Q16; full rate if no axis interpolates."""
        return self._group.wanted_q16 if self._group.members else FULL_RATE_Q16

    def present_rate(self) -> int:
        """Return the present rate of the group's time in Q16, which may be on a ramp."""
        return self._group.rate_q16(self._context.board.motion.tick)

    def want_rate(self, rate_q16: int) -> None:
        """Request another rate of the group; refuse it without a motion, or if the records do not allow it.

        The present request may always be written again, as by a master that writes back what it has read.
        """
        if rate_q16 == self.wanted_rate():
            return
        if not self._group.members:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if rate_q16 > self._context.board.motion.highest_rate_q16:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH)
        self._group.wanted_q16 = rate_q16

    def highest_rate(self) -> int:
        """Return the highest rate at which this axis' records keep the step rate limit."""
        return self._motion.highest_rate_q16

    def allow_rate(self, rate_q16: int) -> None:
        """Check the following records with their step rate at this rate; refuse if records are queued."""
        if self._motion.running or self._motion.queued:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self._motion.highest_rate_q16 = rate_q16

    # --- the mode

    def control(self, controlword: int, previous: int) -> None:
        """Start the queue in the next tick when the enable bit rises; stop it by a ramp when the bit falls.

        The halt bit concerns the group (see `Firmware`): a queue started during a halt waits at its first record.
        """
        enabled = controlword & Control.START
        if self._running and not enabled:
            self._stop.ramp_down(StopKind.SLOW_DOWN)
            self.interrupted()
        elif (
            enabled
            and not previous & Control.START
            and not self._motion.running  # a stop ramp may still move the axis
            and self._motion.start(in_group=True)
        ):
            self._running = True
            self._dictionary.set(od.PVT_LEAST_FILL, QUEUE_DEPTH)
            self._flags_changed()

    def finished(self) -> None:
        """Handle the end of the queue at standstill."""
        self._running = False
        self._flags_changed()

    def _flags_changed(self) -> None:
        self._context.changed(od.PVT_FLAGS)

    def discard(self) -> None:
        """Drop the waiting records and close the queue: their numbers are used, so the host must start again."""
        if self._motion.queued:
            self._motion.flush()
            self.stopped()

    def stopped(self) -> None:
        """Close the queue, because it was stopped before its end."""
        self._closed = True
        self.finished()

    def close(self) -> None:
        """Close the queue, because another mode takes over the axis."""
        if not self._closed:
            self.stopped()

    def interrupted(self) -> None:
        """Close a running queue, because the drive stops the motion or leaves OPERATION ENABLED."""
        if self._running:
            self.stopped()

    def target_reached(self) -> bool:
        """Return bit 10 of the statusword: standstill, at the end or in a halt."""
        return not self._motion.running or self._motion.halted

    def underrun(self) -> None:
        """Handle an underrun: the queue is empty while the axis moves."""
        self._sticky |= PvtFlag.UNDERRUN
        self._dictionary.cell(od.PVT_UNDERRUNS).count()
        self.stopped()

    @property
    def coordinated(self) -> bool:
        """True while records are executed."""
        return self._running

    def status_bits(self) -> int:
        """Return bit 12: interpolation is active."""
        return Status.IP_ACTIVE if self._running else 0

    # --- status and counters

    def free_records(self) -> int:
        """Return the number of free places in the queue."""
        return 0 if self._closed else QUEUE_DEPTH - self._motion.queued

    def flags(self) -> int:
        """Return the flags of the PVT status (2012h:03)."""
        flags = self._sticky
        queued = self._motion.queued
        if queued == 0:
            flags |= PvtFlag.EMPTY
        if self._running:
            flags |= PvtFlag.RUNNING
            if queued <= self._dictionary.get(od.QUEUE_LOW_WATER):
                flags |= PvtFlag.LOW
        elif self.ready and queued:
            flags |= PvtFlag.ARMED
        return flags

    def executing_sequence(self) -> int:
        """Return the sequence number of the present record, or of the last one."""
        behind = self._motion.queued + 1
        return (self.next_sequence - behind) % SEQUENCE_MODULUS
