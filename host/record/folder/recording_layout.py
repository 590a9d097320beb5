"""Name the files of a recording in progress and say what its header and its marks hold.

`recording.part` is a folder. Its files only grow, and a mark is the last that is written of each piece: whatever ends
the recording, all up to its last mark can be read.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from steptwin.host.common.tables import Table
from steptwin.host.record.folder.edges_file import AxisTotals
from steptwin.host.record.folder.layout import FOLDER_VERSION, RECORDING, VERSION_KEY, check_version
from steptwin.host.robots.board_settings import ActiveEdge
from steptwin.host.verify import DriverLimit

HEADER: Final = "header.json"
"""File that is there, complete, from the beginning of a recording to its end."""
MARKS: Final = "marks.jsonl"
"""File with a line for each piece: the values of the mark that differ from the mark before, and longer files."""
PLAN: Final = "plan.csv"
"""File with the rows of trajectory.csv, of one motion after the other."""
NOTHING: Final = "nothing was recorded"

_COUNTS_MAX: Final = float(1 << 62)


def unfinished(folder: Path) -> bool:
    """Return whether a folder holds a recording that has no end."""
    return (folder / RECORDING / HEADER).is_file()


@dataclass(frozen=True, slots=True)
class Header:
    """What is known of a recording from its beginning.

    Attributes:
        robot: the robot's name.
        driver_profile: name of the drivers.
        bitrate: of the bus, in bit/s.
        axes: in the order of the joints.
    """

    robot: str
    driver_profile: str
    bitrate: int
    axes: tuple[AxisTotals, ...]

    def text(self) -> str:
        """Return the header as JSON."""
        axes = [axis._asdict() | {"limits": [asdict(limit) for limit in axis.limits]} for axis in self.axes]
        own = {"robot": self.robot, "driver_profile": self.driver_profile, "bitrate": self.bitrate}
        return json.dumps({VERSION_KEY: FOLDER_VERSION, **own, "axes": axes}, indent=2) + "\n"

    @staticmethod
    def of(table: Table) -> "Header":
        """Return the header in a JSON object; raise InputError for a missing key, a wrong value or another version."""
        check_version(table.values.get(VERSION_KEY))
        return Header(
            table.text("robot"), table.text("driver_profile"), table.integer("bitrate"), table.each("axes", _totals)
        )


def _totals(axis: Table) -> AxisTotals:
    edge = axis.choice("active_edge", ActiveEdge)
    return AxisTotals(axis.text("name"), axis.integer("start_steps"), edge, axis.each("limits", _limit))


def _limit(limit: Table) -> DriverLimit:
    texts = (limit.text(key) for key in ("rule", "broken", "unit", "source"))
    rule, broken, unit, source = texts
    return DriverLimit(rule, broken, limit.number("limit"), unit, source)


@dataclass(frozen=True, slots=True)
class Mark:
    """How far a recording goes.

    Attributes:
        until_counts: instant up to which every edge is recorded.
        start_counts: t = 0 of the motion that is shown: the last one that a SYNC started and that has a plan, else the
            last one; 0 if there was none.
        frames: number of frames in the bus log.
        no_plan: reason why there is no plan of that motion; None if its rows so far are recorded.
        in_motion: True if that motion has not come to its end.
        plan_from: place of that motion's first row in the file of the plans, in bytes.
        plan_to: place behind its last row; 0 if that is the end of the file.
        next_counts: instant when a later motion began, of which the plan says nothing; 0 if there was none.
        load_percent: load of the bus since power-up.
        wall_s: seconds on the wall clock since power-up.
    """

    until_counts: int = 0
    start_counts: int = 0
    frames: int = 0
    no_plan: str | None = NOTHING
    in_motion: bool = False
    plan_from: int = 0
    plan_to: int = 0
    next_counts: int = 0
    load_percent: float = 0.0
    wall_s: float = 0.0

    def line(self, before: "Mark", sizes: Mapping[str, int]) -> str:
        """Return what is new since the mark before, with the sizes in bytes of the files that have grown."""
        old = asdict(before)
        new: dict[str, Any] = {key: value for key, value in asdict(self).items() if value != old[key]}
        return json.dumps(new | ({"sizes": dict(sizes)} if sizes else {})) + "\n"

    def after(self, line: Table) -> "Mark":
        """Return the mark that a line makes of this one; raise InputError for a wrong value."""
        values: dict[str, Any] = asdict(self)
        for key in ("until_counts", "start_counts", "frames", "plan_from", "plan_to", "next_counts"):
            if key in line:
                values[key] = line.integer(key, _COUNTS_MAX)
        for key in ("load_percent", "wall_s"):
            if key in line:
                values[key] = line.number(key)
        if "in_motion" in line:
            values["in_motion"] = line.truth("in_motion")
        if "no_plan" in line:
            values["no_plan"] = None if line.is_null("no_plan") else line.text("no_plan")
        return Mark(**values)
