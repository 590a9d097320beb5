"""Planned path of the tool, distance of the counted path, and the magnification that makes it visible."""

from dataclasses import dataclass
from math import floor, log10
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import printable, shortened
from steptwin.host.verify import Comparison, RunInfo
from steptwin.host.verify.deviation import deviations


def run_name(run: RunInfo) -> str:
    """Return the robot, and the job or its file's name."""
    job = Path(run.job).name if run.job.endswith(_FILES) else run.job
    return f"{printable(shortened(run.robot))} · {printable(shortened(job))}"


def heading(run: RunInfo, *what: str) -> str:
    """Return a heading: robot, job, subject, and that the run is simulated."""
    return f"{' · '.join((run_name(run), *what))} (SIMULATED)"


_FILES: Final = (".toml", ".csv", ".json", ".yaml", ".yml")
"""Suffixes of jobs that are files."""

MAGNIFIED_PART: Final = 0.04
"""Largest size of the magnified error, as a fraction of the path's extent."""

STILL_MM: Final = 1e-6
"""Largest change of a coordinate at standstill, from rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class PathError:
    """Planned tool positions and the errors of the counted ones in mm, each of shape (n, 3), in order of time."""

    planned_mm: FloatArray
    errors_mm: FloatArray

    @property
    def extents_mm(self) -> FloatArray:
        """The planned extent of each coordinate, shape (3,)."""
        extents_mm = np.ptp(self.planned_mm, axis=0)
        return np.where(extents_mm > STILL_MM, extents_mm, 0.0)

    @property
    def gain(self) -> float:
        """1, 2 or 5 times a power of ten that makes the error visible, but small against the path."""
        extent_mm, error_mm = self.extents_mm.max(), np.abs(self.errors_mm).max()
        wanted = MAGNIFIED_PART * float(extent_mm / error_mm) if error_mm > 0.0 else 1.0
        return max(1.0, round_below(wanted)) if wanted > 1.0 else 1.0

    def counted_mm(self, gain: float = 1.0) -> FloatArray:
        """The counted positions with their errors magnified, shape (n, 3)."""
        return self.planned_mm + gain * self.errors_mm


def round_below(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above a positive value."""
    decade = 10.0 ** floor(log10(value))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= value)


def path_error(comparison: Comparison, t_s: FloatArray) -> PathError:
    """Return the path just before and just after each of m sorted instants, n = 2 m; without a tool, zeros."""
    if not comparison.expected.task.width:
        return PathError(np.zeros((2 * len(t_s), 3)), np.zeros((2 * len(t_s), 3)))
    end_s = comparison.expected.motion.duration_s
    tools = (part.tool for part in deviations(comparison, t_s) if part.tool is not None)
    errors_mm = np.concatenate([tool.position_mm.swapaxes(0, 1).reshape(-1, 3) for tool in tools])
    poses = comparison.expected.forward(comparison.expected.motion.positions(np.minimum(t_s, end_s)))
    return PathError(np.repeat(poses[:, :3], 2, axis=0), errors_mm)
