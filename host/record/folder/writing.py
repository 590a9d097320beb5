"""Write the folder of a run: report, robot, plan, every edge, bus log and a waveform."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import refuse_link
from steptwin.host.common.whole_file import whole_file, write_json, write_whole
from steptwin.host.planning.errand import PlannedStock
from steptwin.host.planning.plan import Plan
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.folder.edges_file import write_edges
from steptwin.host.record.folder.layout import BUS_LOG, EDGES, REPORT, ROBOT, SHELF, TRAJECTORY
from steptwin.host.record.folder.motion import write_motion
from steptwin.host.record.folder.report_file import write_shelf
from steptwin.host.record.folder.run_pictures import DEFAULT_PICTURES, can_draw
from steptwin.host.record.waveforms import Format, whole_record, wires, write_waveform
from steptwin.host.verify import Evidence
from steptwin.protocol.frame import Frame


def run_files() -> tuple[str, ...]:
    """Return the names of the files of a run."""
    names = (REPORT, ROBOT, TRAJECTORY, EDGES, BUS_LOG, SHELF, Format.VCD.file_name)
    return (*names, *(f"{name}.png" for name in DEFAULT_PICTURES)) if can_draw() else names


def prepare_folder(out: Path | str, files: Iterable[str] = ()) -> Path:
    """Make the folder before the work for it begins.

    Raises:
        InputError: it cannot be made or written to, it holds a symbolic link, or a folder in it has the name of a file
            that is to be written.
    """
    if not str(out).strip():
        raise InputError(f"out={str(out)!r}: the name of the folder is empty")
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in folder.iterdir():
            refuse_link(path)
    except OSError as error:
        what = "" if error.filename == str(folder) else f"{Path(error.filename).name}: "
        raise InputError(f"out={out}: {what}{error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"out={out}: is not writable")
    for name in files:
        if (folder / name).is_dir():
            raise InputError(f"out={out}: {name} in it is a folder, where a file is to be written")
    return folder


def write_folder(
    out: Path,
    document: Mapping[str, Any],
    plan: Plan,
    evidence: Evidence,
    bus_log: Sequence[tuple[int, Frame]],
    stock: PlannedStock | None = None,
) -> None:
    """Write every file but the pictures.

    The document is the one that `run --json` prints, with FOLDER_VERSION under VERSION_KEY; `stock` is what the motion
    is planned to leave at the shelf.
    """
    write_json(out / REPORT, document)
    write_whole(out / ROBOT, plan.robot.toml)
    write_motion(out / TRAJECTORY, plan)
    write_edges(out / EDGES, evidence)
    if evidence.shelf is not None:
        write_shelf(out, evidence.shelf, stock)
    with whole_file(out / BUS_LOG) as file:
        file.writelines(log_line(*entry).encode() for entry in bus_log)
    write_waveform(
        out / Format.VCD.file_name,
        wires(evidence),
        whole_record(evidence),
        Format.VCD,
        plan.robot.name,
    )
