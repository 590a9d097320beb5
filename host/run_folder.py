"""What `--out DIR` holds after a run: the report, the plan, every edge, every pin, the bus, and pictures where
matplotlib is installed."""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from emulator.candump import candump_lines
from host.recording import BUS_LOG, EDGES, PINS, REPORT, TRAJECTORY, PinLog, write_edges
from host.run import Outcome


def write_folder(out: Path, outcome: Outcome, document: dict[str, Any]) -> bool:
    """Write everything; return False if the pictures had to be left out because matplotlib is not installed."""
    (out / REPORT).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    _write_trajectory(out / TRAJECTORY, outcome)
    write_edges(out / EDGES, outcome.comparison.evidence)
    with (out / PINS).open("w", encoding="utf-8") as pins:
        PinLog(pins, outcome.plan.robot).append(outcome.pin_changes)
    with (out / BUS_LOG).open("w", encoding="ascii") as log:
        log.writelines(candump_lines(outcome.bus_log))
    if not find_spec("matplotlib"):
        return False
    from host.plots import write_plots

    write_plots(out, outcome.comparison, outcome.report.run)
    return True


def _write_trajectory(path: Path, outcome: Outcome) -> None:
    """The plan at its PVT points: seconds, then mm or degrees of each joint."""
    t_s = outcome.plan.times_ms / 1000
    rows = np.column_stack((t_s, outcome.plan.trajectory.positions(t_s)))
    header = ",".join(("t", *outcome.plan.robot.joint_names))
    np.savetxt(path, rows, fmt="%.9f", delimiter=",", header=header, comments="")
