"""Limits of the files that the host reads, so that no file can use excessive memory or time.

A reader checks them before it uses the memory. They are far above the files that StepTwin writes; each has its reason
beside it.
"""

from typing import Final

from steptwin.host.common.errors import InputError

KIB: Final = 1 << 10
MIB: Final = 1 << 20
GIB: Final = 1 << 30

ROBOT_BYTES_MAX: Final = 256 * KIB
"""A robot file with every key of eight joints and its comments has some 8 KiB."""
PROGRAM_BYTES_MAX: Final = 1 * MIB
"""A step of a program has some 60 bytes, so all 5000 steps that a program may have fit, with their comments."""
STEP_FILES_BYTES_MAX: Final = 16 * MIB
"""A line of G-code has some 30 bytes: half a million of them fit."""
NAME_CHARS_MAX: Final = 64
"""Longest name in a robot file: it stands in table heads, headings of pictures and names of arrays."""
TITLE_CHARS_MAX: Final = 200
"""Longest title of a robot: one line."""
PAPER_CHARS_MAX: Final = 400
"""Longest citation of a robot's paper: those of the robots here have up to 190 characters."""

REPORT_BYTES_MAX: Final = 16 * MIB
"""A report has some 500 bytes for each axis and for each kind of violation, 10 KiB in all."""

POINTS_MAX: Final = 3_600_001
"""Points of a trajectory file: one each millisecond of the longest motion, an hour. As numbers they take 490 MB."""
COLUMNS_MAX: Final = 35
"""Columns of a CSV trajectory: the time; position, velocity and acceleration of the eight joints that a board drives;
position, attitude and two axes of the tool."""
LINE_CHARS_MAX: Final = 8 * KIB
"""Characters of a CSV line: 35 numbers with all their digits have 900."""
CSV_BYTES_MAX: Final = 3 * GIB
"""A CSV trajectory is read line by line; with all points and eight joints `run` writes 2.1 GB."""
JSON_BYTES_MAX: Final = 64 * MIB
"""A JSON trajectory is read at once and takes ten times its size; half a million points of six joints fit."""
YAML_BYTES_MAX: Final = 8 * MIB
"""A YAML trajectory of this size takes ten seconds to be read; twenty thousand points of six joints, with velocities,
fit."""

LOG_LINE_CHARS_MAX: Final = 256
"""Characters of a line of bus.log: StepTwin's have at most 50."""

RECORDED_BYTES_MAX: Final = 2 * GIB
"""A recorded bus: with 45 characters a frame, ten times the frames that are read."""
RECORDED_LINE_CHARS_MAX: Final = 8 * KIB
"""Characters of a line of a recorded bus: a frame has fewer than 200, but the head of a TRC file holds its path."""
RECORDED_FRAMES_MAX: Final = 5_000_000
"""Frames of a recorded bus: ten minutes of a bus at 1 Mbit/s without a pause; they take 1.3 GB as objects."""

MARK_CHARS_MAX: Final = 64 * KIB
"""Characters of a line of marks.jsonl: with the sizes of all arrays of eight axes it has 11 KiB."""

ARRAYS_BYTES_MAX: Final = 16 * GIB
"""All arrays of edges.npz: a step takes 38 bytes in them (both edges of CLK, the step, the phase currents), so 24 h of
six axes at 800 steps/s each, 415 million steps, fit."""
ARRAYS_RATIO_MAX: Final = 100
"""All arrays over the size of edges.npz: recordings compress to a third, and at a steady speed to a sixth."""
ARRAYS_BYTES_FREE: Final = 16 * MIB
"""Size of all arrays up to which any ratio is accepted: an axis at rest compresses well."""


def size_text(size_bytes: int) -> str:
    """Format a size with the largest unit that does not exceed it."""
    for unit, name in ((GIB, "GiB"), (MIB, "MiB"), (KIB, "KiB")):
        if size_bytes >= unit:
            return f"{size_bytes / unit:.4g} {name}"
    return f"{size_bytes} bytes"


def check_size(size_bytes: int, limit_bytes: int) -> None:
    """Raise InputError if a file is larger than its limit."""
    if size_bytes > limit_bytes:
        raise InputError(f"has {size_bytes} bytes, more than {size_text(limit_bytes)}")
