"""Inventory files: the box in each slot of a robot's shelf, in TOML; docs/warehouse.md has the format.

A job gets its slot or finds its box before its motion is planned; the whole file is written after the run.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.errand import Errand, job_carries
from steptwin.features.shelf.section import Shelf
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX, PROGRAM_BYTES_MAX
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import Table, check_name, toml_table
from steptwin.host.common.whole_file import whole_file
from steptwin.host.robots.robot import Robot

_KEYS: Final = ("robot", "slots", "locked")
SLOT: Final = "slot"
"""Name of the jobs' option for the slot."""


@dataclass(frozen=True, slots=True)
class Inventory:
    """The boxes in the slots of a robot's shelf.

    Attributes:
        robot: name of the robot.
        boxes: box of each occupied slot, in the shelf's order.
        locked: slots with locked drawers; they are neither filled nor emptied.
    """

    robot: str
    boxes: Mapping[str, str] = field(default_factory=dict)
    locked: tuple[str, ...] = ()

    def slot_of(self, box: str) -> str:
        """Return the slot of a box; raise InputError, with the nearest names, if it is not in the shelf."""
        for slot, held in self.boxes.items():
            if held == box:
                self._check_unlocked(slot)
                return slot
        raise unknown("box", box, self.boxes.values())

    def free_slot(self, shelf: Shelf) -> str:
        """Return the first free and unlocked slot of a shelf; raise InputError if there is none."""
        for slot in shelf.slots:
            if slot not in self.boxes and slot not in self.locked:
                return slot
        held = ", ".join(f"{slot} {self.boxes.get(slot, 'is locked')}" for slot in shelf.slots)
        raise InputError(f"no slot is free: {held}")

    def check_slot(self, slot: str, shelf: Shelf, *, filled: bool) -> None:
        """Raise InputError if a slot is locked, or is not `filled` as required."""
        self._check_unlocked(slot)
        if filled and slot not in self.boxes:
            raise InputError(f"slot {slot}: is empty; the filled ones are {', '.join(self.boxes) or 'none'}")
        if not filled and slot in self.boxes:
            free = [name for name in shelf.slots if name not in self.boxes and name not in self.locked]
            raise InputError(f"slot {slot}: holds {self.boxes[slot]}; free are {', '.join(free) or 'none'}")

    def check_new(self, box: str) -> None:
        """Raise InputError if a name is invalid for a box, or taken by a box in the shelf."""
        _check_box(box)
        for slot, held in self.boxes.items():
            if held == box:
                raise InputError(f"box {box!r}: is in slot {slot} already; each box has a name of its own")

    def _check_unlocked(self, slot: str) -> None:
        if slot in self.locked:
            raise InputError(f"slot {slot}: its drawer is locked")


@dataclass(frozen=True, slots=True)
class Assignment:
    """A job with the slot of an inventory: its options, and the errand."""

    options: Mapping[str, str]
    errand: Errand


def assign(robot: Robot, job: str, options: Mapping[str, str], inventory: Inventory, box: str | None) -> Assignment:
    """Choose the slot for a job that carries boxes.

    A job that stores a box takes a free slot unless the options name one. A job that fetches a box finds it by its name
    or its slot. A new box needs a name that no box in the shelf has.

    Raises:
        InputError: the job carries no boxes, a name is missing, unknown or taken, or the slot has a wrong state.
    """
    shelf = shelf_of(robot)
    carries = job_carries(robot, job, options)
    if shelf is None or not carries:
        raise InputError(f"job {job}: carries no boxes, so it needs no inventory")
    first = carries[0]
    if len(carries) > 1:
        chosen = dict(options)
    elif first.target in shelf.slots:
        chosen = _to_store(shelf, options, inventory, first.target)
    else:
        chosen = _to_fetch(shelf, options, inventory, first.source, box)
    carries = job_carries(robot, job, chosen)
    stock = dict(inventory.boxes)
    if carries[0].source in shelf.spots:
        if box is None:
            raise InputError(f"job {job}: the box needs a name, as in `steptwin run {robot.name} {job} NAME`").plainly(
                f"{job}: the box needs a name"
            )
        inventory.check_new(box)
        stock[carries[0].source] = box
    errand = Errand(stock, carries)
    errand.stock_after(shelf)
    for carry in carries:
        for slot in {carry.source, carry.target} & set(inventory.locked):
            raise InputError(f"slot {slot}: its drawer is locked")
    return Assignment(chosen, errand)


def _to_store(shelf: Shelf, options: Mapping[str, str], inventory: Inventory, slot: str) -> dict[str, str]:
    if SLOT not in options:
        return {**options, SLOT: inventory.free_slot(shelf)}
    inventory.check_slot(slot, shelf, filled=False)
    return dict(options)


def _to_fetch(
    shelf: Shelf, options: Mapping[str, str], inventory: Inventory, slot: str, box: str | None
) -> dict[str, str]:
    if box is not None:
        found = inventory.slot_of(box)
        if options.get(SLOT, found) != found:
            raise InputError(f"slot {slot}: {box} is in slot {found}")
        return {**options, SLOT: found}
    if SLOT not in options:
        raise InputError("which box? Its name or its slot is needed; there are " + (_listed(inventory) or "none"))
    inventory.check_slot(slot, shelf, filled=True)
    return dict(options)


def _listed(inventory: Inventory) -> str:
    return ", ".join(f"{box} in {slot}" for slot, box in inventory.boxes.items())


# --- the file


def read_inventory(path: str, robot: Robot) -> Inventory:
    """Read an inventory; a missing file is an empty shelf.

    Raises:
        InputError: the robot has no shelf, or the file is invalid or another robot's; one message for each error.
    """
    shelf = shelf_of(robot)
    if shelf is None or not shelf.slots:
        raise InputError(f"{path}: {robot.name} has no shelf")
    if not Path(path).exists():
        return Inventory(robot.name)
    with prefixed(f"{path}: "):
        return _parsed(read_text(path, PROGRAM_BYTES_MAX), robot, shelf)


def _parsed(text: str, robot: Robot, shelf: Shelf) -> Inventory:
    table, findings = toml_table(text), Findings()
    with findings.collecting():
        table.check_keys(_KEYS)
    with findings.collecting():
        if table.text("robot") != robot.name:
            raise InputError(f"robot: the inventory is for {table.text('robot')}, not for {robot.name}")
    boxes, locked = dict[str, str](), tuple[str, ...]()
    with findings.collecting(), table.section("slots") as section:
        boxes = _boxes(section, shelf)
    if "locked" in table:
        with findings.collecting():
            locked = _locked(table, shelf)
    findings.raise_first()
    return Inventory(robot.name, boxes, locked)


def _boxes(section: Table, shelf: Shelf) -> dict[str, str]:
    findings, slot_of = Findings(), dict[str, str]()
    for slot in section:
        with findings.collecting():
            if slot not in shelf.slots:
                raise unknown(f"{slot}: slot", slot, shelf.slots)
            box = section.text(slot)
            if not box:
                continue
            with prefixed(f"{slot}: "):
                _check_box(box)
                if box in slot_of:
                    raise InputError(f"{box!r} is in slot {slot_of[box]} already")
            slot_of[box] = slot
    findings.raise_first()
    boxes = {slot: box for box, slot in slot_of.items()}
    return {slot: boxes[slot] for slot in shelf.slots if slot in boxes}


def _locked(table: Table, shelf: Shelf) -> tuple[str, ...]:
    given = table.elements("locked")
    findings = Findings()
    for i, slot in enumerate(given):
        with findings.collecting():
            if slot not in shelf.slots:
                raise unknown(f"locked[{i}]: slot", str(slot), shelf.slots)
    findings.raise_first()
    return tuple(slot for slot in shelf.slots if slot in given)


def _check_box(box: str) -> None:
    if not box:
        raise InputError("the name of a box is empty")
    check_name(box, NAME_CHARS_MAX)


def written_after(inventory: Inventory, errand: Errand, shelf: Shelf) -> Inventory:
    """Return the inventory after an errand."""
    stock = errand.stock_after(shelf)
    return replace(inventory, boxes={slot: stock[slot] for slot in shelf.slots if slot in stock})


def write_inventory(path: str, before: Inventory, after: Inventory, robot: Robot) -> None:
    """Write a whole inventory in place of the one that was read.

    Raises:
        InputError: the file has been changed since it was read.
        OSError: writing failed.
    """
    if read_inventory(path, robot) != before:
        raise InputError(f"{path}: has been changed since it was read; the run made it {_listed(after) or 'empty'}")
    lines = [
        f"# The boxes in the shelf of {after.robot}; `steptwin run --inventory` writes this file after verified runs.",
        f"robot = {_quoted(after.robot)}",
    ]
    if after.locked:
        lines.append(f"locked = [{', '.join(map(_quoted, after.locked))}]")
    lines += ["", "[slots]", *(f"{_quoted(slot)} = {_quoted(box)}" for slot, box in after.boxes.items())]
    with whole_file(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode("utf-8"))


def _quoted(text: str) -> str:
    """Return a printable text as a TOML string; TOML escapes as JSON does."""
    return json.dumps(text, ensure_ascii=False)
