"""G-code for tool paths: blocks, modal words, and cuts without a stop; the step `gcode` of programs."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.features.gcode.options import GcodeOptions


def _program_steps() -> Mapping[str, Any]:
    from steptwin.features.gcode.gcode_step import GcodeTable

    return {"gcode": GcodeTable}


def _file_options() -> "type[GcodeOptions]":
    from steptwin.features.gcode.options import GcodeOptions

    return GcodeOptions


FEATURE: Final = Feature(name="gcode", needs=("fastest",), program_steps=_program_steps, file_options=_file_options)
