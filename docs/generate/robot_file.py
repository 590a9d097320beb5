"""Read a robot's TOML file with its comments, which give the source of each number."""

import re
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

_SECTION: Final = re.compile(r"\[([\w.-]+)\](?:\s*#\s*(.*))?")
_ENTRY: Final = re.compile(r"(\w+)\s*=\s*(.*?)(?:\s+#\s*(?:(\[[SDA]\])\s*)?(.*))?")


@dataclass(frozen=True, slots=True)
class Entry:
    """A value as written, without quotes; its mark `[S]`, `[D]` or `[A]` and its note, either of which may be empty."""

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
    entries: dict[str, Entry]


def read_robot_file(robot: str) -> dict[str, Section]:
    """Read a robot of the collection; return its sections by name, as in `joints.th1`, in the file's order."""
    sections = {"": Section("", {})}
    last = ""
    for line in (files("steptwin.host.robots") / f"{robot}.toml").read_text(encoding="utf-8").splitlines():
        if header := _SECTION.fullmatch(line):
            last = header[1]
            sections[last] = Section(header[2] or "", {})
        elif entry := _ENTRY.fullmatch(line):
            sections[last].entries[entry[1]] = Entry(entry[2].strip('"'), entry[3] or "", entry[4] or "")
    return sections
