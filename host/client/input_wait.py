"""Waits for digital inputs on the way of a trajectory, and the legs into which they divide it."""

from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

from steptwin.host.client.output_schedule import OutputCommand
from steptwin.host.common.axis_records import AxisRecords
from steptwin.protocol.cia402 import DigitalInput


class InputWait(NamedTuple):
    """Stand still until an input of an axis has a level, or until the time-out ends the motion.

    Attributes:
        axis: number of the axis that has the input.
        input: bit of the input in the digital inputs (60FDh).
        on: the level to wait for: True is active.
        at_s: time of the trajectory at which the machine stands, where one record ends and the next begins.
        timeout_s: longest wait, in trajectory time.
        timeout_text: message of the error after the time-out.
    """

    axis: int
    input: DigitalInput
    on: bool
    at_s: float
    timeout_s: float
    timeout_text: str


class Leg(NamedTuple):
    """Part of a trajectory between two waits: the records of each axis and the output commands within it.

    Output times count from the trajectory's start, without the time that the waits before have taken.
    """

    records: tuple[AxisRecords, ...]
    outputs: tuple[OutputCommand, ...]


def divide(
    records: tuple[AxisRecords, ...], outputs: Sequence[OutputCommand], waits: Sequence[InputWait]
) -> tuple[Leg, ...]:
    """Return the legs of a trajectory: one more than it has waits.

    Raises:
        ValueError: a wait is at no record's beginning, or the waits are not in order of time.
    """
    begins_ms = [0, *accumulate(records[0].durations_ms)]
    at_ms = [round(1000 * wait.at_s) for wait in waits]
    cuts = [0, *(begins_ms.index(each_ms) for each_ms in at_ms), len(begins_ms) - 1]
    if cuts != sorted(cuts):
        raise ValueError(f"the waits at {at_ms} ms are not in order of time")
    limits_ms = [-1, *(each_ms - 1 for each_ms in at_ms), begins_ms[-1]]  # an output at a wait comes after it
    return tuple(
        Leg(
            tuple(AxisRecords(*(fields[begin:end] for fields in own)) for own in records),
            tuple(command for command in outputs if after_ms < round(1000 * command.from_s) <= until_ms),
        )
        for (begin, end), (after_ms, until_ms) in zip(pairwise(cuts), pairwise(limits_ms), strict=True)
    )
