"""What `--out DIR` leaves: the report, the robot, the plan, every edge, the bus, a waveform, and pictures."""

import os
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from host.errors import InputError
from host.run_folder.edges import write_edges
from host.run_folder.layout import BUS_LOG, EDGES, REPORT, ROBOT, TRAJECTORY
from host.run_folder.motion import write_motion
from host.run_folder.reading import read_run
from host.run_folder.report import write_report
from host.waveforms import DEFAULT_SCALE, Format, whole_record, wires, write_waveform
from host.whole_file import whole_file

if TYPE_CHECKING:
    from host.run import Outcome


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


def write_folder(out: Path, outcome: "Outcome", document: Mapping[str, Any]) -> bool:
    """Write everything; return False if the pictures had to be left out because matplotlib is not installed.

    The document is what `run --json` prints, with FOLDER_VERSION under VERSION_KEY. The pictures are drawn from the
    folder, so that `plot` draws the same: the motion in it may be a little off the one that was planned.
    """
    from emulator.candump import candump_lines

    evidence = outcome.comparison.evidence
    write_report(out / REPORT, document)
    with whole_file(out / ROBOT) as file:
        file.write(outcome.plan.robot.toml.encode())
    write_motion(out / TRAJECTORY, outcome.plan)
    write_edges(out / EDGES, evidence)
    with whole_file(out / BUS_LOG) as file:
        file.writelines(line.encode() for line in candump_lines(outcome.bus_log))
    write_waveform(
        out / Format.VCD.file_name,
        wires(evidence),
        whole_record(evidence),
        Format.VCD,
        DEFAULT_SCALE,
        outcome.plan.robot.name,
    )
    if not find_spec("matplotlib"):
        return False
    from host.plots import write_plots

    stored = read_run(out)
    write_plots(out, stored.comparison, stored.report.run)
    return True
