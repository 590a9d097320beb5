"""The pictures of a run's motors."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

from steptwin.host.record.plots.canvas import STYLE, save_figure
from steptwin.host.studies.motors.pictures.load_angle import draw_load_angle
from steptwin.host.studies.motors.pictures.resonance import draw_resonance
from steptwin.host.studies.motors.pictures.tool import draw_tool
from steptwin.host.studies.motors.pictures.torque import draw_torque
from steptwin.host.twin.motors import MotorRun
from steptwin.host.verify import RunInfo

__all__ = ["DEFAULT_PICTURES", "PICTURES", "write_motor_pictures"]

PICTURES: Final[dict[str, Callable[[MotorRun, RunInfo], Figure]]] = {
    "motor-load": draw_load_angle,
    "motor-torque": draw_torque,
    "motor-tool": draw_tool,
    "motor-resonance": draw_resonance,
}
"""Pictures by the names of their files."""


DEFAULT_PICTURES: Final = ("motor-load", "motor-torque", "motor-tool")
"""Pictures that are drawn into the folder of a run with --motors; the other takes longer than most runs."""


def write_motor_pictures(
    folder: Path, ran: MotorRun, run: RunInfo, names: Iterable[str] = DEFAULT_PICTURES
) -> list[Path]:
    """Draw the pictures into a folder, made if missing; return the paths of the files."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):
        for name in names:
            path = folder / f"{name}.png"
            save_figure(PICTURES[name](ran, run), path, {})
            paths.append(path)
    return paths
