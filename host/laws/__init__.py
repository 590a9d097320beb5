"""Time laws: how a distance is covered from rest to rest."""

from host.laws.law import Law
from host.laws.polynomial import Cubic, Quintic
from host.laws.s_curve import SCurve
from host.laws.trapezoid import Trapezoid

__all__ = ["Cubic", "Law", "Quintic", "SCurve", "Trapezoid"]
