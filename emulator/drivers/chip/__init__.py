"""One driver chip, modelled by the behaviour of its pins as its sheet says (`protocol.drivers`)."""

from steptwin.emulator.drivers.chip.chip import DriverChip
from steptwin.emulator.drivers.chip.output_follower import FieldTurns, OutputChanges, OutputFollower, Steady
from steptwin.emulator.drivers.chip.outputs import ChipOutputs

__all__ = ["ChipOutputs", "DriverChip", "FieldTurns", "OutputChanges", "OutputFollower", "Steady"]
