"""The folder that `run --out DIR` leaves: writing it, reading it, and verifying it again from its files alone."""

from host.run_folder.edges import read_edges
from host.run_folder.layout import FOLDER_VERSION, VERSION_KEY, ContradictionError
from host.run_folder.reading import StoredRun, read_robot, read_run
from host.run_folder.report import read_report
from host.run_folder.verdict import Verdict, verify_folder
from host.run_folder.writing import prepare_folder, write_folder

__all__ = [
    "FOLDER_VERSION",
    "VERSION_KEY",
    "ContradictionError",
    "StoredRun",
    "Verdict",
    "prepare_folder",
    "read_edges",
    "read_report",
    "read_robot",
    "read_run",
    "verify_folder",
    "write_folder",
]
