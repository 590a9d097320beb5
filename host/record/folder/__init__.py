"""Write the folder of a run, read it, and verify the run again from its files alone.

`layout` names the files, `writing` writes and draws them, `reading` makes plan and evidence from them, `verdict` judges
them, `digests` detects files of another run.
"""

from steptwin.host.record.folder.digests import digests
from steptwin.host.record.folder.edges_file import AxisTotals, read_edges
from steptwin.host.record.folder.layout import (
    BUS_LOG,
    EDGES,
    FOLDER_VERSION,
    LIVE_JOB,
    RECORDING,
    REPLAY_JOB,
    REPORT,
    ROBOT,
    TEST_JOB,
    VERSION_KEY,
    ContradictionError,
    MachineStop,
    StoppedError,
)
from steptwin.host.record.folder.motion import trajectory_head, trajectory_row
from steptwin.host.record.folder.reading import (
    StoredRun,
    check_axes,
    read_evidence,
    read_recording,
    read_robot,
    read_run,
    stored_motion,
)
from steptwin.host.record.folder.recording import Piece, PlanRows, Recording, keep_any_run, keep_log, keep_recording
from steptwin.host.record.folder.report_file import read_report, stop_document
from steptwin.host.record.folder.unfinished import Header, Mark
from steptwin.host.record.folder.verdict import FolderVerdict, mixture, verify_folder
from steptwin.host.record.folder.writing import older_files, prepare_folder, run_files, write_folder

__all__ = [
    "BUS_LOG",
    "EDGES",
    "FOLDER_VERSION",
    "LIVE_JOB",
    "RECORDING",
    "REPLAY_JOB",
    "REPORT",
    "ROBOT",
    "TEST_JOB",
    "VERSION_KEY",
    "AxisTotals",
    "ContradictionError",
    "FolderVerdict",
    "Header",
    "MachineStop",
    "Mark",
    "Piece",
    "PlanRows",
    "Recording",
    "StoppedError",
    "StoredRun",
    "check_axes",
    "digests",
    "keep_any_run",
    "keep_log",
    "keep_recording",
    "mixture",
    "older_files",
    "prepare_folder",
    "read_edges",
    "read_evidence",
    "read_recording",
    "read_report",
    "read_robot",
    "read_run",
    "run_files",
    "stop_document",
    "stored_motion",
    "trajectory_head",
    "trajectory_row",
    "verify_folder",
    "write_folder",
]
