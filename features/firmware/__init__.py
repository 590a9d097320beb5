"""A user's own firmware, compiled for this computer, on an emulated board."""

from typing import Final

from steptwin.host.common.features import Feature

FEATURE: Final = Feature(
    name="firmware",
)
