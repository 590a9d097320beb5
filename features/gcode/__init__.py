"""G-code for tool paths: blocks, modal words, and cuts without a stop."""

from typing import Final

from steptwin.host.common.features import Feature

FEATURE: Final = Feature(
    name="gcode",
)
