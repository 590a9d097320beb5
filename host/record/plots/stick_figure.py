"""Draw an arm as a stick figure projected onto a plane, at some instants of a motion or at one position."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import ArmPart, Role

BETWEEN: Final = "#c98a4b"
"""Colour of the arm along its way: ochre, light beside the path in print."""
AT_ENDS: Final = "#7a3d00"
"""Colour of the arm at start and end: dark brown, distinct from the path."""

_WIDTHS: Final = {Role.GUIDE: 1.0, Role.SLIDE: 3.0, Role.LINK: 2.0, Role.TOOL: 1.2, Role.HAND: 1.2}


@dataclass(frozen=True, slots=True)
class Pen:
    """The look of a stick figure: colour, opaqueness from 0 to 1, and the style of its lines."""

    colour: str
    alpha: float = 1.0
    style: Literal["-", "--"] = "-"


def draw_arm(
    axes: Axes, links: Iterable[ArmPart], instants: Sequence[int], plane: FloatArray, pen: Pen, label: str = ""
) -> None:
    """Draw the arm at some instants of its links, projected onto a plane; joints are dots.

    Guides, which may be far longer than the arm, do not enlarge the view.

    Args:
        axes: where to draw; with equal scales.
        links: parts of the arm at n instants.
        instants: indexes of the instants.
        plane: shape (3, 2), the columns are the directions in space that are drawn across and up.
        pen: colour and style.
        label: its name in a legend; empty for none.
    """
    for link in links:
        places = [link.points_mm[instant] @ plane for instant in instants]
        gap = np.full((1, 2), np.nan)
        points = np.vstack([part for place in places for part in (gap, place)][1:])
        line = Line2D(
            *points.T,
            color=pen.colour,
            alpha=pen.alpha / 2 if link.role is Role.GUIDE else pen.alpha,
            linestyle=pen.style,
            linewidth=_WIDTHS[link.role],
            marker="o" if link.role is Role.LINK else "",
            markersize=3,
            solid_capstyle="round",
        )
        if link.role is Role.GUIDE:
            axes.add_artist(line)  # unlike add_line it keeps the view
            continue
        if link.role is Role.LINK and label:
            line.set_label(label)
            label = ""
        axes.add_line(line)


def plane_of(across: int, up: int) -> FloatArray:
    """Return the plane of two coordinates, 0 for x, 1 for y, 2 for z, as `draw_arm` takes it."""
    return np.eye(3)[:, [across, up]]
