"""Drilling cycles: the moves of which they are made."""

import pytest

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.dialects import Dialect
from steptwin.features.gcode.modal import CutMove, Dwell, RapidMove, actions
from tests.host.complaints import complaint_of

START = (0.0, 0.0, 10.0, 0.0)


def moves(text: str) -> list[tuple[str, tuple[float, ...]]]:
    """Return the moves: G0 or G1 with its place, or a dwell with its duration."""
    found = read_blocks(f"G94 F600\n{text}", Dialect.LINUXCNC)
    rows: list[tuple[str, tuple[float, ...]]] = []
    for each in actions(found.blocks, START, START, found.manners):
        match each:
            case RapidMove(_, goal):
                rows.append(("G0", goal[:3]))
            case CutMove():
                assert each.feed_mm_s == 10.0
                rows.append(("G1", each.goal[:3]))
            case Dwell(_, time_s):
                rows.append(("G4", (time_s,)))
    return rows


def heights(text: str) -> list[float]:
    return [places[-1] for _, places in moves(text)]


def test_holes_in_a_row_end_at_the_first_height() -> None:
    hole = [("G0", 2, 10), ("G0", 2, 2), ("G1", 2, -3), ("G0", 2, 10)]
    assert moves("G81 X1 Y2 Z-3 R2\nX5\nG80") == [(word, (x, y, z)) for x in (1.0, 5.0) for word, y, z in hole]


def test_g99_ends_at_r() -> None:
    assert heights("G99 G81 X1 Z-3 R2\nX5 Z-4") == [10, 2, -3, 2, 2, -4, 2]
    assert heights("G99 G81 X1 Z-3 R2\nG98 X5\nG0 Z1\nG98 G81 X1 Z-3 R.5") == [
        *(10, 2, -3, 2), *(2, -3, 10), 1, *(1, 0.5, -3, 1),
    ]  # fmt: skip


def test_below_r_it_rises_first() -> None:
    assert heights("G0 Z1\nG81 X1 Z-3 R2") == [1, 2, 2, -3, 2]


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("G82 X1 Z-3 R2 P.5", [10, 2, -3, 0.5, 10]),
        ("G85 X1 Z-3 R2", [10, 2, -3, 2, 10]),
        ("G89 X1 Z-3 R2 P.5", [10, 2, -3, 0.5, 2, 10]),
        ("G83 X1 Z-3 R2 Q2", [10, 2, 0, 2, 0.254, -2, 2, -1.746, -3, 10]),
        ("G83 X1 Z-2 R2 Q2", [10, 2, 0, 2, 0.254, -2, 10]),
        ("G73 X1 Z-3 R2 Q4", [10, 2, -2, -1.746, -3, 10]),
        ("G73 X1 Z-3 R2 Q5", [10, 2, -3, 10]),
        ("G20 G81 X1 Z0 R.1", [10, 2.54, 0, 10]),
        ("G92 Z0\nG81 X1 Z-3 R-1", [10, 9, 7, 10]),
        ("G91 G81 X1 Z-3 R-4", [10, 6, 3, 10]),
    ],
)
def test_each_cycle(line: str, wanted: list[float]) -> None:
    if "G20" in line:
        line = line.replace("G20", "G20 F23.622047244094488")
    assert heights(line) == pytest.approx(wanted)


def test_repetitions_go_on_by_their_increments() -> None:
    assert [places[0] for _, places in moves("G91 G81 X3 Z-3 R-4 L3")][::4] == [3.0, 6.0, 9.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("G81 X1 Z-3", "G81: R is missing"),
        ("G81 X1 R2", "G81: Z is missing"),
        ("G81 X1 R2 Z3", "G81: R is below Z, the bottom"),
        ("G83 X1 R2 Z1", "G83: Q is missing or not above 0, the depth of a peck"),
        ("G81 X1 R2 Z1 L0", "L0: a number of repetitions is from 1 to 10000"),
        ("G81 X1 R2 Z1 L10001", "L10001: a number of repetitions is from 1 to 10000"),
        ("G18 G81 X1 R2 Z1", "G81: a cycle is along z, with G17 and G94"),
        ("G81 X1 R2 Z1 P3", "P3: no word of the line takes it"),
        ("G81 X1 R2 Z1 Q3", "Q3: goes with G64"),
    ],
)
def test_what_is_refused(text: str, message: str) -> None:
    told = complaint_of(lambda: moves(text))
    assert told.startswith(f"line 2: {message}"), told
