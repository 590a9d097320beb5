"""G-code for tool paths: blocks, modal words, and cuts without a stop; the step `gcode` of programs."""

from collections.abc import Mapping
from typing import Any, Final

from steptwin.host.common.features import Feature


def _program_steps() -> Mapping[str, Any]:
    from steptwin.features.gcode.gcode_step import GcodeTable

    return {"gcode": GcodeTable}


FEATURE: Final = Feature(name="gcode", needs=("fastest",), program_steps=_program_steps)
