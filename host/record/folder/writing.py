"""Write the folder of a run: report, robot, plan, every edge, bus log and a waveform."""

import os
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from steptwin.host.common.errors import InputError
from steptwin.host.common.features import judge_of
from steptwin.host.common.own_files import refuse_link
from steptwin.host.common.whole_file import files_together, whole_file, write_json, write_whole
from steptwin.host.planning.plan import Plan
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.folder.digests import digests
from steptwin.host.record.folder.edges_file import write_edges
from steptwin.host.record.folder.layout import (
    BUS_LOG,
    EDGES,
    REPORT,
    ROBOT,
    TRAJECTORY,
    feature_file,
    feature_files,
)
from steptwin.host.record.folder.motion import write_motion
from steptwin.host.record.folder.reading import read_run
from steptwin.host.record.plots import PICTURES, RUN_PICTURES, write_plots
from steptwin.host.record.waveforms import Format, whole_record, wires, write_waveform
from steptwin.host.verify import Evidence
from steptwin.protocol.frame import Frame


def run_files() -> tuple[str, ...]:
    """Return the names of the files of a run."""
    return (*_files(), *(f"{name}.png" for name in RUN_PICTURES)) if can_draw() else _files()


def _files() -> tuple[str, ...]:
    return (REPORT, ROBOT, TRAJECTORY, EDGES, BUS_LOG, *feature_files(), Format.VCD.file_name)


def prepare_folder(out: Path | str, files: Iterable[str] = ()) -> Path:
    """Create the folder before a run, and check that it can be written.

    Raises:
        InputError: it cannot be created or written, has a symbolic link, or has a folder with the name of a file to
            write.
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
    expected: Mapping[str, Any] | None = None,
) -> None:
    """Write all files but the pictures, together, in place of an older run's.

    The document is that of `run --json`, with FOLDER_VERSION under VERSION_KEY; `expected` is what features expect of
    the motion.
    """
    with files_together(out, REPORT, older_files()) as new:
        write_whole(new / ROBOT, plan.robot.toml)
        write_motion(new / TRAJECTORY, plan)
        write_edges(new / EDGES, evidence)
        with whole_file(new / BUS_LOG) as file:
            file.writelines(log_line(*entry).encode() for entry in bus_log)
        for name, seen in evidence.features.items():
            held = judge_of(name).stored(seen, (expected or {}).get(name), evidence.start_counts)
            write_json(new / feature_file(name), held)
        write_waveform(
            new / Format.VCD.file_name,
            wires(evidence),
            whole_record(evidence),
            Format.VCD,
            plan.robot.name,
        )
        write_json(new / REPORT, {**document, **digests(new)})


def older_files() -> tuple[str, ...]:
    """Return the names of all files that belong to a folder's run, with all its pictures."""
    return (*_files(), *(f"{name}.png" for name in PICTURES))


def can_draw() -> bool:
    """Return whether pictures can be drawn: matplotlib is installed."""
    return find_spec("matplotlib") is not None


def draw_pictures(folder: Path) -> None:
    """Draw the pictures of the run in a folder; raise OSError if writing fails.

    The folder is their source, as for `plot`, so the pictures are equal: the stored motion differs slightly from the
    planned one (see `motion`), and so does the instant of the largest error.
    """
    stored = read_run(folder)
    write_plots(folder, RUN_PICTURES, stored.report.run, stored.comparison, stored.report.document)
