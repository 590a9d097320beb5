"""Touch probes (CiA 402-2, "touch probe functionality"): latch the position at edges of the inputs IN1 and IN2.

Probe 1 is IN1, probe 2 is IN2. In the touch probe function (60B8h) and status (60B9h), the low byte is probe 1, the
high byte probe 2:

| bit | function | status |
|---|---|---|
| 0 | the probe is on | the probe is on |
| 1 | 0: latch the first edge of each kind, 1: every edge | a position at a rising edge is stored |
| 2, 3 | source: 0, the input | a position at a falling edge is stored (bit 2) |
| 4 | latch rising edges | |
| 5 | latch falling edges | |

A status bit falls when its kind of edge is switched off; the position stays. Other sources are refused, because an open
loop drive has no encoder with a zero pulse. The manufacturer-specific bits are refused, too.

The drive reads its inputs once per servo tick of 250 us and latches its step counter at the start of that tick. So a
position is late by up to the travel in one tick: speed times 250 us. All state is in the dictionary.
"""

from typing import Final, NamedTuple

from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, TouchProbeBit
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError


class _Latch(NamedTuple):
    """One kind of edge of one probe: its bits in the function and status words, and the entry that it latches."""

    probe_input: DigitalInput
    rising: bool
    enabled: int
    """Bits of the function that must all be set to latch."""
    continuous: int
    stored: int
    position: int
    """Address of the latched position."""


def _latches(probe_input: DigitalInput, shift: int, rising_at: int, falling_at: int) -> tuple[_Latch, _Latch]:
    """Return the two latches of one probe, with its bits shifted by `shift`."""
    bit, on, continuous = TouchProbeBit, TouchProbeBit.ON << shift, TouchProbeBit.CONTINUOUS << shift
    return (
        _Latch(probe_input, True, on | bit.RISING << shift, continuous, bit.RISING_STORED << shift, rising_at),
        _Latch(probe_input, False, on | bit.FALLING << shift, continuous, bit.FALLING_STORED << shift, falling_at),
    )


_PROBE_2: Final = 8
"""Shift of probe 2's bits in the words."""
_LATCHES: Final = (
    *_latches(DigitalInput.IN1, 0, od.TOUCH_PROBE_1_RISING, od.TOUCH_PROBE_1_FALLING),
    *_latches(DigitalInput.IN2, _PROBE_2, od.TOUCH_PROBE_2_RISING, od.TOUCH_PROBE_2_FALLING),
)
_ONE_PROBE: Final = TouchProbeBit.ON | TouchProbeBit.CONTINUOUS | TouchProbeBit.RISING | TouchProbeBit.FALLING
_OFFERED: Final = _ONE_PROBE | _ONE_PROBE << _PROBE_2


class TouchProbes:
    """The two touch probes of one axis."""

    def __init__(self, context: AxisContext) -> None:
        self._context = context
        self._dictionary = context.dictionary
        context.dictionary.bind(self)

    def obey_function(self, function: int) -> None:
        """Switch the probes on and off.

        Raises:
            SdoAbortError: another source than the input, or a bit that this drive does not support (06090030h).
        """
        if function & ~_OFFERED:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        stored = self._dictionary.get(od.TOUCH_PROBE_STATUS)
        on = function & (TouchProbeBit.ON | TouchProbeBit.ON << _PROBE_2)
        kept = sum(row.stored & stored for row in _LATCHES if function & row.enabled == row.enabled)
        self._show(on | kept)

    def inputs_changed(self, before: DigitalInput, inputs: DigitalInput) -> None:
        """Latch the position at the edges that are enabled."""
        function = self._dictionary.get(od.TOUCH_PROBE_FUNCTION)
        for row in _LATCHES:
            edge = (before ^ inputs) & row.probe_input and bool(inputs & row.probe_input) is row.rising
            if not edge or function & row.enabled != row.enabled:
                continue
            status = self._dictionary.get(od.TOUCH_PROBE_STATUS)
            if status & row.stored and not function & row.continuous:
                continue
            self._dictionary.set(row.position, self._context.motion.counter_units)
            self._show(status | row.stored)

    def _show(self, status: int) -> None:
        """Store the status and announce it, even if it is unchanged: the position is new."""
        self._dictionary.set(od.TOUCH_PROBE_STATUS, status)
        self._context.changed(od.TOUCH_PROBE_STATUS)
