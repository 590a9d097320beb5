"""What rounds the corner between two paths of the tool."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.poses import Task
from steptwin.host.robots.poses.rotations import of_rotation_vector, turned

if TYPE_CHECKING:
    from scipy.interpolate import BPoly


@dataclass(frozen=True, slots=True, eq=False)
class ToolRounding:
    """What rounds the corner between two paths of the tool; implements ToolPath.

    A tool that turns in space turns by the rest of the first path's turn, then by the second's, each with the part that
    the polynomial of the place has of its direction.

    Attributes:
        task: task of the tool.
        curve: places, or whole poses of a flat task, as a polynomial of the length, from 0 to `length_mm`.
        corner: orientation at the corner, the columns of a pose behind x, y and z.
        rates: turn of the tool before and after the corner, both of shape (3,), in degrees for each mm.
    """

    task: Task
    curve: "BPoly"
    corner: FloatArray
    rates: tuple[FloatArray, FloatArray]

    @property
    def length_mm(self) -> float:
        """Length of both parts of the legs that it replaces."""
        return float(self.curve.x[-1])

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width)."""
        columns = np.asarray(self.curve(s_mm))
        if self.task.is_flat:
            return columns
        before, after = self._parts(s_mm)
        first = self.task.carried(of_rotation_vector(before * self.rates[0]), self.corner)
        return np.column_stack([columns, self.task.carried(of_rotation_vector(after * self.rates[1]), first)])

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return the poses' derivatives by the length s, of shape (n, task.rates), in mm/mm and deg/mm."""
        columns = np.asarray(self.curve(s_mm, 1))
        if self.task.is_flat:
            return columns
        _, after = self._parts(s_mm)
        z = (2.0 * s_mm / self.length_mm - 1.0)[:, np.newaxis]
        gained = 0.5 + 0.75 * z - 0.25 * z**3
        carried = turned(np.broadcast_to(self.rates[0], (len(s_mm), 3)), of_rotation_vector(after * self.rates[1]))
        return np.column_stack([columns, carried * (1.0 - gained) + self.rates[1] * gained])

    def _parts(self, s_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the lengths by which the tool is turned before and after the corner, both of shape (n, 1)."""
        r = self.length_mm / 2.0
        t = (s_mm - r)[:, np.newaxis]
        z = t / r
        after = r * (3.0 / 16.0 + z / 2.0 + 3.0 * z**2 / 8.0 - z**4 / 16.0)
        return t - after, after
