"""Interpolated position mode: PVT records come in by sequence number and run as cubic segments of the kernel.

A queue that was stopped, for whatever reason, is closed: it takes no record until the host has cleared it (0x60C4:06),
so that a stream still under way cannot set an axis moving again.
"""

from collections.abc import Callable

from steptwin.controller.kernel import I32_MAX
from steptwin.controller.modes import Mode, Report
from steptwin.controller.motion import Motion, Refusal
from steptwin.controller.soft_limits import SoftLimits, hull
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.cia402 import Control, ErrorCode, Status
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.pvt import QUEUE_DEPTH, SEQUENCE_MODULUS, PvtFlag, Verdict, judge

_STICKY = {Verdict.GAP: PvtFlag.GAP, Verdict.FULL: PvtFlag.OVERFLOW}


class Interpolation(Mode):
    """One axis' PVT queue as the bus sees it: flow control, status 0x2012 and counters 0x2013."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        report: Report,
        resolved: Callable[[ErrorCode], None],
        status_changed: Callable[[], None],
        ramp_down: Callable[[], None],
    ) -> None:
        super().__init__(axis, motion)
        self._dictionary = dictionary
        self._report = report
        self._resolved = resolved
        self._status_changed = status_changed
        self._ramp_down = ramp_down
        self._next_sequence = 0
        self._sticky = 0
        """The flags that stay until they are cleared."""
        self._running = False
        self._closed = False
        self.ready = False
        """Whether the drive is enabled in this mode: a queue with records is then armed."""
        self._install_hooks()
        self._limits = SoftLimits(dictionary)
        self._displacement_units = dictionary.reader(od.PVT_DISPLACEMENT)
        self._end_velocity = dictionary.reader(od.PVT_END_VELOCITY)
        self._duration_ms = dictionary.reader(od.PVT_DURATION_MS)
        self._least_fill = dictionary.reader(od.PVT_LEAST_FILL)

    def _install_hooks(self) -> None:
        self._dictionary.write_hooks[od.PVT_SEQUENCE] = self._record_arrived
        self._dictionary.write_hooks[od.BUFFER_CLEAR] = self._clear
        self._dictionary.read_hooks |= {
            od.PVT_NEXT_SEQUENCE: lambda: self._next_sequence,
            od.PVT_FREE_RECORDS: lambda: self._free(self._motion.queued(self._axis)),
            od.PVT_FLAGS: self._flags,
            od.PVT_EXECUTING_SEQUENCE: self._executing,
            od.DELAYED_STEPS: lambda: self._motion.delayed_steps(self._axis),
            od.BUFFER_POSITION: lambda: self._motion.queued(self._axis),
        }

    # --- records in

    def _record_arrived(self, sequence: int) -> None:
        """Writing the sequence number queues the record whose other fields were written before it."""
        queued = self._motion.queued(self._axis)
        verdict = judge(sequence, self._next_sequence, self._free(queued))
        if verdict is Verdict.STALE:
            return
        if verdict is not Verdict.PUSH:
            self._drop(verdict)
            return
        if self._running and queued < self._least_fill():
            self._dictionary.set(od.PVT_LEAST_FILL, queued)
        refusal = self._push(self._displacement_units(), self._end_velocity(), self._duration_ms())
        if refusal is not Refusal.ACCEPTED:
            self._reject(sequence, refusal)
            return
        self._next_sequence = (sequence + 1) % SEQUENCE_MODULUS
        if self._sticky:
            self._sticky &= ~(PvtFlag.GAP | PvtFlag.OVERFLOW)
        self._dictionary.count(od.PVT_ACCEPTED)

    def _push(self, displacement_units: int, end_velocity: int, duration_ms: int) -> Refusal:
        """Queue a segment unless it leads out of the soft limits, or further out of them."""
        low, high = self._limits.range()
        if low > -I32_MAX or high < I32_MAX:
            start, velocity = self._motion.tail_units(self._axis), self._motion.tail_velocity(self._axis)
            least, most = hull(start, velocity, displacement_units, end_velocity, duration_ms)
            if least < min(low, start) or most > max(high, start):
                return Refusal.SOFT_LIMIT
        return self._motion.push(self._axis, displacement_units, end_velocity, duration_ms)

    def _drop(self, verdict: Verdict) -> None:
        """Flag a gap or an overflow; only the first of a row is an event, so that junk cannot flood the bus."""
        flag = _STICKY[verdict]
        self._dictionary.count(od.PVT_GAPS if verdict is Verdict.GAP else od.PVT_OVERFLOWS)
        if not self._sticky & flag:
            self._sticky |= flag
            self._status_changed()

    def _reject(self, sequence: int, refusal: Refusal) -> None:
        self._sticky |= PvtFlag.REJECTED
        self._report(ErrorCode.SEGMENT_REFUSED, refusal << 8 | sequence)
        self._status_changed()
        raise SdoAbortError(AbortCode.VALUE_RANGE)

    def _clear(self, value: int) -> None:
        """0x60C4:06 = 0 empties the queue and begins again with sequence number 0; not while it runs."""
        if value:
            return
        if self._motion.running(self._axis):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self._motion.flush(self._axis)
        self.restart()

    def restart(self) -> None:
        """Begin again with sequence number 0 and no flags, open for records."""
        self._next_sequence = 0
        self._sticky = 0
        self._resolved(ErrorCode.SEGMENT_REFUSED)
        self.finished()
        self._closed = False

    # --- the mode

    def control(self, controlword: int, previous: int) -> None:
        """Start the queue in the next tick when the enable bit rises; stop it when that falls.

        The halt bit is the group's (see `Firmware`): what is started during a halt rests at its first record's start.
        """
        enabled = controlword & Control.START
        if self._running and not enabled:
            self._ramp_down()
        elif enabled and not previous & Control.START and self._start():
            self._running = True
            self._dictionary.set(od.PVT_LEAST_FILL, QUEUE_DEPTH)
            self._status_changed()

    def _start(self) -> bool:
        """Begin with the first record, unless a ramp is still bringing the axis to rest."""
        return not self._motion.running(self._axis) and self._motion.start(self._axis, in_group=True)

    def finished(self) -> None:
        """The queue ran out at rest."""
        self._running = False
        self._status_changed()

    def discard(self) -> None:
        """Drop the records that wait, if any; their numbers are taken, so that the host must clear the queue first."""
        if self._motion.queued(self._axis):
            self._motion.flush(self._axis)
            self.stopped()

    def stopped(self) -> None:
        """The queue was stopped before its end: close it."""
        self._closed = True
        self.finished()

    def close(self) -> None:
        """Another mode moves the axis: take no more records until the host clears the queue."""
        if not self._closed:
            self.stopped()

    def interrupted(self) -> None:
        """The drive stops the motion or leaves OPERATION ENABLED."""
        if self._running:
            self.stopped()

    def target_reached(self) -> bool:
        """Standstill, at the end or in a halt."""
        return not self._motion.running(self._axis) or self._motion.halted(self._axis)

    def underrun(self) -> None:
        """The queue ran out while moving."""
        self._sticky |= PvtFlag.UNDERRUN
        self._dictionary.count(od.PVT_UNDERRUNS)
        self.stopped()

    @property
    def coordinated(self) -> bool:
        """Whether records are being executed."""
        return self._running

    def status_bits(self) -> int:
        """Bit 12: interpolation is active."""
        return Status.IP_ACTIVE if self._running else 0

    # --- status and counters

    def _free(self, queued: int) -> int:
        return 0 if self._closed else QUEUE_DEPTH - queued

    def _flags(self) -> int:
        flags = self._sticky
        queued = self._motion.queued(self._axis)
        if queued == 0:
            flags |= PvtFlag.EMPTY
        if self._running:
            flags |= PvtFlag.RUNNING
            if queued <= self._dictionary.get(od.QUEUE_LOW_WATER):
                flags |= PvtFlag.LOW
        elif self.ready and queued:
            flags |= PvtFlag.ARMED
        return flags

    def _executing(self) -> int:
        behind = self._motion.queued(self._axis) + 1
        return (self._next_sequence - behind) % SEQUENCE_MODULUS
