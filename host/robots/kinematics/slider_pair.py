"""The planar parallel mechanism of two vertical sliders: two links of equal length meet at the point c = (z2, z3).

The screws are at -h and +h; the sliders on them are at heights Z5 and Z6:

    (z2 + h)^2 + (z3 - Z5)^2 = L^2        (z2 - h)^2 + (z3 - Z6)^2 = L^2

Each slider may be below c or above it: four working modes. For given sliders, c may be above or below the line through
them: two assembly modes. A machine always keeps its modes, because a change would pass through a singularity.
All arguments and results are in mm and arrays of one shape.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError


class WorkingMode(Enum):
    """Sides of sliders 5 and 6: below c (+) or above it (-); machines work in the first mode."""

    BOTH_BELOW = "(+,+)"
    RIGHT_ABOVE = "(+,-)"
    LEFT_ABOVE = "(-,+)"
    BOTH_ABOVE = "(-,-)"

    @property
    def signs(self) -> tuple[int, int]:
        """e5 and e6: +1 for a slider below c, -1 for a slider above it."""
        return (1 if self.value[1] == "+" else -1), (1 if self.value[3] == "+" else -1)


class AssemblyMode(Enum):
    """Side of the line through the sliders on which c is."""

    ABOVE = 1
    BELOW = -1


@dataclass(frozen=True, slots=True)
class SliderPair:
    """The mechanism by h, half the distance between the screws, and L, the links' length, in mm; 0 < h < L."""

    h_mm: float
    L_mm: float

    def __post_init__(self) -> None:
        if not 0 < self.h_mm < self.L_mm:
            raise InputError(f"h_mm: {self.h_mm:g} mm is not above 0 and below the links' L_mm, {self.L_mm:g} mm")

    @property
    def reach_mm(self) -> float:
        """The largest |z2| where both links still reach their screws."""
        return self.L_mm - self.h_mm

    def forward(
        self, left_mm: FloatArray, right_mm: FloatArray, assembly: AssemblyMode
    ) -> tuple[FloatArray, FloatArray]:
        """Return z2 and z3 for Z5 and Z6; NaN where the sliders are further apart than the links allow."""
        apart = left_mm - right_mm
        square = 4.0 * self.L_mm**2 / (4.0 * self.h_mm**2 + apart**2) - 1.0
        k = np.sqrt(np.where(square >= 0.0, square, np.nan))
        return assembly.value * apart * k / 2.0, (left_mm + right_mm) / 2.0 + assembly.value * self.h_mm * k

    def inverse(self, z2_mm: FloatArray, z3_mm: FloatArray, mode: WorkingMode) -> tuple[FloatArray, FloatArray]:
        """Return Z5 and Z6; NaN where |z2| is beyond reach."""
        (left_sign, right_sign), (left_rise, right_rise) = mode.signs, self._rises(z2_mm)
        return z3_mm - left_sign * left_rise, z3_mm - right_sign * right_rise

    def assembly_of(self, z2_mm: FloatArray, mode: WorkingMode) -> FloatArray:
        """Return the assembly mode, +1 or -1, of a working mode with c at this z2; 0 where a mixed mode is singular."""
        (left_sign, right_sign), (left_rise, right_rise) = mode.signs, self._rises(z2_mm)
        above = (self.h_mm - z2_mm) * left_sign * left_rise + (self.h_mm + z2_mm) * right_sign * right_rise
        return np.sign(above)

    def slider_velocities(
        self, left_mm: FloatArray, right_mm: FloatArray, z2_mm: FloatArray, z3_mm: FloatArray,
        dz2: FloatArray, dz3: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return the sliders' velocities for the velocity (dz2, dz3) of c; not finite where a link is level."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (
                dz3 + (z2_mm + self.h_mm) / (z3_mm - left_mm) * dz2,
                dz3 + (z2_mm - self.h_mm) / (z3_mm - right_mm) * dz2,
            )

    def sines(
        self, left_mm: FloatArray, right_mm: FloatArray, z2_mm: FloatArray, z3_mm: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the sine of each link's slope and of the angle between the links; 0 at a singularity."""
        left_rise, right_rise = z3_mm - left_mm, z3_mm - right_mm
        cross = (z2_mm + self.h_mm) * right_rise - (z2_mm - self.h_mm) * left_rise
        return np.abs(left_rise) / self.L_mm, np.abs(right_rise) / self.L_mm, np.abs(cross) / self.L_mm**2

    def _rises(self, z2_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the height difference between the ends of each link, never negative; NaN out of reach."""
        squares = (self.L_mm**2 - (z2_mm + self.h_mm) ** 2, self.L_mm**2 - (z2_mm - self.h_mm) ** 2)
        left, right = (np.sqrt(np.where(square >= 0.0, square, np.nan)) for square in squares)
        return left, right
