"""A digital input of the board to which a sensor of the machine's surroundings is wired."""

from dataclasses import dataclass
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import GENERAL_INPUTS, DigitalOutput

OUTPUTS_PER_AXIS: Final = len(DigitalOutput)


@dataclass(frozen=True, slots=True)
class Output:
    """A digital output: the joint whose axis has it, and its number there, from 1 to OUTPUTS_PER_AXIS."""

    joint: str
    out: int

    def __post_init__(self) -> None:
        if not 1 <= self.out <= OUTPUTS_PER_AXIS:
            raise InputError(f"out: {self.out} is not from 1 to {OUTPUTS_PER_AXIS}")


INPUTS_PER_AXIS: Final = len(GENERAL_INPUTS)


@dataclass(frozen=True, slots=True)
class Input:
    """A digital input: the joint whose axis has it, and its number there, from 1 to INPUTS_PER_AXIS."""

    joint: str
    input: int

    def __post_init__(self) -> None:
        if not 1 <= self.input <= INPUTS_PER_AXIS:
            raise InputError(f"input: {self.input} is not from 1 to {INPUTS_PER_AXIS}")
