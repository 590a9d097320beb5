"""The objects that show what an axis does and what its board measures at the moment of reading."""

from typing import Final

from steptwin.controller.axis_context import AxisContext
from steptwin.controller.axis_drive import AxisDrive
from steptwin.protocol import od
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_I32_MIN: Final = -(1 << 31)
_I32_MAX: Final = (1 << 31) - 1


def install_present_values(context: AxisContext, drive: AxisDrive) -> None:
    """Install the read hooks of positions, velocity, inputs and measurements."""
    axis, motion, board = context.axis, context.motion, context.board
    context.dictionary.read_hooks |= {
        od.BOARD_TEMPERATURE: lambda: board.measurements.temperature_decidegc,
        od.SUPPLY_VOLTAGE: lambda: board.measurements.supply_10mv,
        od.ROTOR_POSITION_STEPS: lambda: board.monitor(axis).rotor_steps,
        od.LOST_STEPS: lambda: board.monitor(axis).lost_steps,
        od.DRIVER_VIOLATIONS: lambda: board.monitor(axis).violations,
        od.DRIVER_MICROSTEPS: lambda: board.monitor(axis).microsteps,
        od.SHAFT_POSITION: lambda: _saturated(board.shaft(axis).position_units),
        od.SLIPPED_FULL_STEPS: lambda: board.shaft(axis).slipped_full_steps,
        od.MODE_OF_OPERATION_DISPLAY: lambda: drive.mode_number,
        od.POSITION_DEMAND: lambda: _saturated(motion.demand_units(axis)),
        od.POSITION_ACTUAL: lambda: _saturated(motion.counter_units(axis)),
        od.VELOCITY_ACTUAL: lambda: motion.velocity(axis) * 1000 // VELOCITY_PER_UNIT_PER_MS,
        od.FOLLOWING_ERROR_ACTUAL: lambda: _saturated(context.reference.following_error_units),
        od.POSITION_DEMAND_STEPS: lambda: motion.demand_steps(axis),
        od.DIGITAL_INPUTS: lambda: drive.supervision.inputs,
    }


def _saturated(units: int) -> int:
    """Limit a position to i32: within a segment, or rounded to a step, an axis may be a little beyond that range."""
    return _I32_MIN if units < _I32_MIN else min(units, _I32_MAX)
