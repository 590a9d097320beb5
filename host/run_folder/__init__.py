"""The folder that `--out DIR` leaves: writing it, reading it, and verifying a run again from its files alone."""

from host.run_folder.edges import AxisTotals, read_edges
from host.run_folder.layout import (
    BUS_LOG,
    EDGES,
    FOLDER_VERSION,
    REPORT,
    ROBOT,
    TRAJECTORY,
    VERSION_KEY,
    ContradictionError,
)
from host.run_folder.motion import trajectory_head, trajectory_row
from host.run_folder.reading import StoredRun, read_robot, read_run
from host.run_folder.report import read_report, write_report
from host.run_folder.spool import EdgeSpool
from host.run_folder.verdict import Verdict, verify_folder
from host.run_folder.writing import prepare_folder, write_folder

__all__ = [
    "BUS_LOG",
    "EDGES",
    "FOLDER_VERSION",
    "REPORT",
    "ROBOT",
    "TRAJECTORY",
    "VERSION_KEY",
    "AxisTotals",
    "ContradictionError",
    "EdgeSpool",
    "StoredRun",
    "Verdict",
    "prepare_folder",
    "read_edges",
    "read_report",
    "read_robot",
    "read_run",
    "trajectory_head",
    "trajectory_row",
    "verify_folder",
    "write_folder",
    "write_report",
]
