"""Further CANopen nodes on the bus, each with the object dictionary of an EDS or DCF."""

from typing import Final

from steptwin.host.common.features import Feature

FEATURE: Final = Feature(
    name="nodes",
)
