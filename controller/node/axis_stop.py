"""Bring one axis to rest, by a ramp or at once."""

from steptwin.controller.motion.board_motion import STOP_MAX_MS
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.stops import HALTS, StopKind
from steptwin.protocol import od
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS


class AxisStop:
    """Stops one axis; an axis that is stopped at speed without a ramp loses its position reference."""

    def __init__(self, context: AxisContext) -> None:
        self._axis = context.axis
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._reference = context.reference

    def duration_ms(self, kind: StopKind) -> int:
        """Return how long a stop from the present velocity takes: at least 1 ms, at most STOP_MAX_MS."""
        if kind.value is None:
            return 1
        velocity = abs(self._motion.velocity(self._axis))
        deceleration = self._dictionary.get(kind.value) * VELOCITY_PER_UNIT_PER_MS
        return min(max(1, -(-velocity * 1_000_000 // deceleration)), STOP_MAX_MS)

    @property
    def halt_kind(self) -> StopKind:
        """The kind of stop that the halt option code (605Dh) selects."""
        return HALTS[self._dictionary.get(od.HALT_OPTION)]

    def halt_deceleration(self) -> int:
        """Return the deceleration of a halt in units/s^2."""
        return self._dictionary.get(self.halt_kind.value)

    def ramp_down(self, kind: StopKind, duration_ms: int | None = None) -> None:
        """Stop with constant deceleration, within `duration_ms` if given; at once if the ramp leaves the i32 range."""
        velocity = self._motion.velocity(self._axis)
        self._motion.stop(self._axis, self.duration_ms(kind) if duration_ms is None else duration_ms)
        if velocity and not self._motion.running(self._axis):
            self._reference.lose()

    def cut(self) -> None:
        """End all pulses now. A motor in motion coasts on, and its steps are not counted."""
        if self._motion.velocity(self._axis):
            self._reference.lose()
        self._motion.flush(self._axis)
