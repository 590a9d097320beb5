"""The folder itself: its files, and the evidence that is in it."""

import os
from pathlib import Path
from typing import Final

from host.errors import InputError
from host.recording.edges import read_edges
from host.recording.pins import read_outputs
from host.verify import Evidence

REPORT: Final = "report.json"
TRAJECTORY: Final = "trajectory.csv"
EDGES: Final = "edges.npz"
PINS: Final = "pins.csv"
BUS_LOG: Final = "bus.log"


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


def read_evidence(folder: Path) -> Evidence:
    """What a folder says about its last motion, for the verifier.

    Raises:
        InputError: a file cannot be read, or no SYNC has started a motion.
    """
    edges = read_edges(folder / EDGES)
    if edges.start_counts is None:
        raise InputError(f"{folder}: no SYNC has started a motion in this run")
    return Evidence(edges.start_counts, edges.axes, read_outputs(folder / PINS))
