"""Read the kernel's source: constants, records of storage, functions and comments."""

import ast
import io
import tokenize
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from steptwin.controller.motion import kernel
from steptwin.emulator.kernel_c.ranges import Range, promised

PATH: Final = Path(kernel.__file__)
PUBLIC: Final = ("push", "next_segment", "advance_axis", "advance", "demand_rate", "group_time_q16")
"""The functions of the C interface; all others are static."""
_RECORDS: Final = {
    "AXIS_FIELDS": ("axis", ""),
    "GROUP_FIELDS": ("group", ""),
    "SEGMENT_FIELDS": ("segment", "SEGMENT_"),
}
"""What ends each list of fields: the record's name in C, and the prefix that its fields lose there."""
RECORD_OF: Final = {"Axes": "axis", "Queue": "segment", "Group": "group"}
"""The record that each kind of storage consists of."""


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a record: the kernel's index of the cell, its name in C, its promise and its place in C."""

    constant: str
    index: int
    name: str
    range: Range
    storage: str
    offset: int
    size: int


@dataclass(frozen=True, slots=True)
class Record:
    """A C structure, members in the order of their offsets: the widest first, so that only its end is padded."""

    name: str
    members: tuple[Member, ...]
    size: int


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """The kernel's module, taken apart."""

    tree: ast.Module
    functions: dict[str, ast.FunctionDef]
    constants: dict[str, int]
    """All integers of the module but the fields, by name."""
    records: dict[str, Record]
    fields: dict[str, tuple[str, Member]]
    """Record and member, by the constant that is the member's index."""
    comments: dict[int, tuple[int, str]]
    """Column and text of each comment, by line."""


@cache
def kernel_source() -> Source:
    """Return the source of the kernel that is imported."""
    text = PATH.read_text(encoding="utf-8")
    tree = ast.parse(text)
    records = _records(tree)
    fields = {member.constant: (record.name, member) for record in records.values() for member in record.members}
    return Source(
        tree,
        {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")},
        {
            name: value
            for name, value in vars(kernel).items()
            if name.isupper() and type(value) is int and name not in fields and name not in _RECORDS
        },
        records,
        fields,
        {
            token.start[0]: (token.start[1], token.string[1:].strip())
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type == tokenize.COMMENT
        },
    )


def width_of(annotation: ast.expr | None) -> str | None:
    """Return the width in an annotation, `U17` or `Final[Annotated[int, U17]]`, or None if it is another type."""
    if isinstance(annotation, ast.Subscript) and ast.unparse(annotation.value) == "Final":
        annotation = annotation.slice
    if isinstance(annotation, ast.Subscript) and isinstance(annotation.slice, ast.Tuple):
        annotation = annotation.slice.elts[-1]
    if isinstance(annotation, ast.Name) and annotation.id[:1] in "UIQ" and annotation.id[1:].isdigit():
        return annotation.id
    return None


def _records(tree: ast.Module) -> dict[str, Record]:
    records: dict[str, Record] = {}
    collected: list[tuple[str, str]] = []
    for node in tree.body:
        if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
            continue
        if width := width_of(node.annotation):
            collected.append((node.target.id, width))
        elif found := _RECORDS.get(node.target.id):
            records[found[0]] = _laid_out(*found, collected)
            collected = []
    return records


def _laid_out(name: str, prefix: str, fields: list[tuple[str, str]]) -> Record:
    """Place members as C does, with natural alignment."""
    ranges = {constant: promised(width) for constant, width in fields}
    members, offset = [], 0
    for constant, _ in sorted(fields, key=lambda field: -ranges[field[0]].storage[1]):
        storage, size = ranges[constant].storage
        member = constant.removeprefix(prefix).lower()
        members.append(Member(constant, getattr(kernel, constant), member, ranges[constant], storage, offset, size))
        offset += size
    alignment = members[0].size
    return Record(name, tuple(members), -(-offset // alignment) * alignment)
