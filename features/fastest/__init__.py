"""Motions as fast as the limits allow: paths through rounded corners, timed from rest to rest."""

from typing import Final

from steptwin.host.common.features import Feature

FEATURE: Final = Feature(
    name="fastest",
)
