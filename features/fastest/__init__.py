"""Motions as fast as the limits allow: paths through rounded corners, timed from rest to rest."""

from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.host.planning.motions.whole import MotionTimer


def _timer() -> "MotionTimer":
    from steptwin.features.fastest.flowing_legs import FastestTimer

    return FastestTimer()


FEATURE: Final = Feature(name="fastest", timer=_timer)
