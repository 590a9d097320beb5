"""Keep recordings: what a live board has recorded cannot be made again, so nothing replaces it unasked."""

from itertools import count
from pathlib import Path
from shlex import quote

from steptwin.host.common.errors import InputError
from steptwin.host.record.folder.layout import EDGES, REPLAY_JOB, TEST_JOB
from steptwin.host.record.folder.recording_layout import unfinished
from steptwin.host.record.folder.report import read_report

_OR_REPLACE = ", or replace=True"


def keep_recording(out: Path | str, or_else: str = "") -> None:
    """Raise InputError if a folder holds the recording of a live board, with its end or without."""
    folder = Path(out)
    if unfinished(folder):
        raise _kept(out, "the recording of a live board that was interrupted, or still runs", or_else)
    if (folder / EDGES).exists() and _live(folder):
        raise _kept(out, "the recording of a live board", or_else)


def keep_any_run(out: Path | str) -> None:
    """Raise InputError if a folder holds the recording of a live board, or any other run."""
    keep_recording(out, _OR_REPLACE)
    if (Path(out) / EDGES).exists():
        raise _kept(out, "a run", _OR_REPLACE)


def keep_log(log: Path | str) -> None:
    """Raise InputError if a file holds something already; pipes and devices hold nothing."""
    path = Path(log)
    if path.is_file() and path.stat().st_size:
        raise InputError(f"log={log}: exists: take another file, such as {quote(str(_free(path)))}{_OR_REPLACE}")


def _live(folder: Path) -> bool:
    """Return whether edges are a live board's: without a readable report they may be (docs/run-folder.md)."""
    try:
        report = read_report(folder)
        return report.passed is None and report.run.job not in (TEST_JOB, REPLAY_JOB)
    except InputError:
        return True


def _kept(out: Path | str, what: str, or_else: str) -> InputError:
    return InputError(f"out={out}: holds {what}: take another folder, such as {quote(str(_free(Path(out))))}{or_else}")


def _free(path: Path) -> Path:
    """Return the first of NAME-2, NAME-3, ... that does not exist."""
    names = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in count(2))
    return next(name for name in names if not name.exists())
