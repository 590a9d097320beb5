"""Time laws: the distance covered from rest to rest, as a function of time."""

from steptwin.host.planning.laws.polynomial import Cubic, Quintic
from steptwin.host.planning.laws.s_curve import SCurve
from steptwin.host.planning.laws.times import Law
from steptwin.host.planning.laws.trapezoid import Trapezoid

__all__ = ["Cubic", "Law", "Quintic", "SCurve", "Trapezoid"]
