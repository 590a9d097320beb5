"""Read robot files with their notes, and make the table of their DH parameters."""

import re
from dataclasses import dataclass
from typing import Final

from docs.generate.markdown import table
from steptwin.host.robots import brought_text
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.robot import Robot

_SECTION: Final = re.compile(r"\[([\w.-]+)\](?:\s*#\s*(.*))?")
_ENTRY: Final = re.compile(r"(\w+)\s*=\s*(.*?)(?:\s+#\s*(?:(\[[SDA]\])\s*)?(.*))?")


@dataclass(frozen=True, slots=True)
class WrittenValue:
    """A value as written, without quotes; its mark `[S]`, `[D]` or `[A]` and its note; both may be empty."""

    value: str
    mark: str
    note: str

    def __str__(self) -> str:
        marked = " ".join(filter(None, (self.value, self.mark)))
        return f"{marked} {self.note}" if self.note else marked


@dataclass(frozen=True, slots=True)
class Section:
    """A table of the file: the comment after its name, and its entries."""

    comment: str
    entries: dict[str, WrittenValue]


def read_robot_file(robot: str) -> dict[str, Section]:
    """Read a robot of the collection; return its sections by name, as in `joints.th1`, in the file's order."""
    sections = {"": Section("", {})}
    last = ""
    for line in brought_text(robot).splitlines():
        if header := _SECTION.fullmatch(line):
            last = header[1]
            sections[last] = Section(header[2] or "", {})
        elif entry := _ENTRY.fullmatch(line):
            sections[last].entries[entry[1]] = WrittenValue(entry[2].strip('"'), entry[3] or "", entry[4] or "")
    return sections


_DH: Final = {
    Convention.STANDARD: (
        "Standard (distal) DH parameters", "theta_i deg", "d_i mm", "a_i mm", "alpha_i deg",
    ),
    Convention.MODIFIED: (
        "Modified (Craig, proximal) DH parameters", "alpha_i-1 deg", "a_i-1 mm", "d_i mm", "theta_i deg",
    ),
}  # fmt: skip
"""For each convention its name, and the columns in their usual order."""


def dh_table(robot: Robot) -> str:
    """Return the DH parameters, with columns in the usual order of the mechanism's convention."""
    dh = make_kinematics(robot).dh
    rows = []
    for i, row in enumerate(dh.rows, start=1):
        cells = [f"{row.alpha_deg:g}", f"{row.a_mm:g}", str(row.d_mm), str(row.theta_deg)]
        rows.append([str(i), *(cells if dh.convention is Convention.MODIFIED else reversed(cells))])
    title, *columns = _DH[dh.convention]
    return f"{title}, from the world to the tool:\n\n{table(['i', *columns], rows)}"
