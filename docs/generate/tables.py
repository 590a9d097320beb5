"""Make the tables of a robot: dimensions, DH parameters, joints, board, outputs, places, options of jobs."""

import re
from dataclasses import dataclass
from typing import Final

from docs.generate.markdown import table
from docs.generate.paper_pages import PAPERS
from steptwin.host.planning.jobs import job_options
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


def dimensions(robot: Robot) -> str:
    """Return the mechanism's dimensions with their marks."""
    return _entries(read_robot_file(robot.name)["kinematics"], without=("kind",))


def board() -> str:
    """Return the board's settings; raise ValueError if they are not the same for all robots of papers."""
    boards = [read_robot_file(name)["board"] for name in PAPERS]
    if any(other != boards[0] for other in boards):
        raise ValueError("the robots' boards differ: describe each with its robot")
    return _entries(boards[0])


def joints(robot: Robot) -> str:
    """Return a column for each joint: its entries in the file, steps per unit, step rate at the highest speed."""
    sections = read_robot_file(robot.name)
    columns = [sections[f"joints.{name}"] for name in robot.joint_names]
    keys = dict.fromkeys(key for section in columns for key in section.entries)
    rows = [["mechanics", *(section.comment for section in columns)]]
    rows += [[key, *(str(section.entries.get(key, "-")) for section in columns)] for key in keys]
    rows.append(["home", *(str(sections["home"].entries[name]) for name in robot.joint_names)])
    rows.append(["steps per mm or deg", *(f"{joint.transmission.steps_per_unit:.9g}" for joint in robot.joints)])
    rows.append(["steps/s at speed_max", *(f"{joint.step_rate_max_hz:.1f}" for joint in robot.joints)])
    return table(["", *robot.joint_names], rows, text_columns=1 + len(columns))


def outputs(robot: Robot) -> str:
    """Return the devices wired to the board's digital outputs."""
    notes = read_robot_file(robot.name)["outputs"].entries
    rows = [
        [name, output.joint, f"OUT{output.out}", f"{notes[name].mark} {notes[name].note}".strip()]
        for name, output in robot.outputs.items()
    ]
    return table(["output", "axis", "pin", "note"], rows, text_columns=4)


def inputs(robot: Robot) -> str:
    """Return the sensors wired to the board's digital inputs."""
    notes = read_robot_file(robot.name)["inputs"].entries
    rows = [
        [name, sensor.joint, f"IN{sensor.input}", f"{notes[name].mark} {notes[name].note}".strip()]
        for name, sensor in robot.inputs.items()
    ]
    return table(["input", "axis", "pin", "note"], rows, text_columns=4)


def places(robot: Robot) -> str:
    """Return the named places that jobs go to; each is marked as a whole."""
    sections = read_robot_file(robot.name)
    rows = [
        [
            name,
            sections[f"places.{name}"].comment,
            *(f"{place[joint]:g}" if joint in place else "-" for joint in robot.joint_names),
        ]
        for name, place in robot.places.items()
    ]
    return table(["place", "note", *robot.joint_names], rows, text_columns=2)


def options(robot: Robot, job: str) -> str:
    """Return a job's options as `steptwin jobs` shows them."""
    rows = [[f"`{name}`", text] for name, text in job_options(robot, job).items()]
    return table(["option", "default (valid)"], rows, text_columns=2)


def _entries(section: Section, without: tuple[str, ...] = ()) -> str:
    rows = [
        [f"`{key}`", entry.value, f"{entry.mark} {entry.note}".strip()]
        for key, entry in section.entries.items()
        if key not in without
    ]
    return table(["key", "value", "note"], rows, text_columns=3)
