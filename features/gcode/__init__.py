"""G-code for tool paths: blocks, modal words, and cuts without a stop; the step `gcode` of programs."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.features.gcode.options import GcodeOptions
    from steptwin.host.planning.programs.program_file import StepReading


def _program_steps() -> "Mapping[str, StepReading]":
    from steptwin.features.gcode.dialects import SUFFIXES
    from steptwin.features.gcode.gcode_step import GCODE_KEYS, GcodeStep
    from steptwin.host.planning.programs.program_file import StepReading

    return {"gcode": StepReading(GCODE_KEYS, GcodeStep.read, SUFFIXES)}


def _file_options() -> "type[GcodeOptions]":
    from steptwin.features.gcode.options import GcodeOptions

    return GcodeOptions


FEATURE: Final = Feature(name="gcode", needs=("fastest",), program_steps=_program_steps, file_options=_file_options)
