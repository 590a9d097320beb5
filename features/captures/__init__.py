"""Captures of a logic analyser: read the files, wire channels to axes, and judge the controller that made them."""

from typing import Final

from steptwin.host.common.features import Feature

FEATURE: Final = Feature(
    name="captures",
)
