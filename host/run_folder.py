"""What `--out DIR` holds: the report, the plan, every edge, the bus, and pictures where matplotlib is installed."""

import json
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from emulator.candump import candump_lines
from host.errors import InputError
from host.run import Outcome
from host.trajectory import FloatArray
from host.verify import COUNTS_PER_SECOND, DriverViolations, Evidence


def prepare_folder(out: str) -> Path:
    """Make the folder before anything runs; InputError if that cannot be."""
    if not out.strip():
        raise InputError("--out: the name of the folder is empty")
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"--out {out}: is not writable")
    return folder


def write_folder(out: Path, outcome: Outcome, document: dict[str, Any]) -> bool:
    """Write everything; return False if the pictures had to be left out because matplotlib is not installed."""
    (out / "report.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    _write_trajectory(out / "trajectory.csv", outcome)
    _write_edges(out / "edges.npz", outcome.comparison.evidence)
    with (out / "bus.log").open("w", encoding="ascii") as log:
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


def _write_edges(path: Path, evidence: Evidence) -> None:
    """Every edge and every accepted step, as arrays named JOINT_WHAT; times in timer counts since boot."""
    arrays: dict[str, Any] = {
        "counts_per_second": np.int64(COUNTS_PER_SECOND),
        "start_counts": np.int64(evidence.start_counts),
    }
    for axis in evidence.axes:
        arrays |= {
            f"{axis.name}_start_steps": np.int64(axis.start_steps),
            f"{axis.name}_clk_rise_counts": axis.clk_rise_counts,
            f"{axis.name}_clk_fall_counts": axis.clk_fall_counts,
            f"{axis.name}_dir_edge_counts": axis.dir_edge_counts,
            f"{axis.name}_dir_levels": axis.dir_levels,
            f"{axis.name}_step_counts": axis.step_counts,
            f"{axis.name}_step_signs": axis.step_signs,
            f"{axis.name}_violation_counts": axis.violations.counts,
            f"{axis.name}_violation_values": axis.violations.values,
            f"{axis.name}_violation_limits": _limits(axis.violations),
        }
    np.savez_compressed(path, **arrays)


def _limits(violations: DriverViolations) -> FloatArray:
    limits = np.array([limit.limit for limit in violations.limits])
    return limits[violations.which]
