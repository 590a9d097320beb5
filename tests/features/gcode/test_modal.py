"""What lines of G-code do, by the words that hold from line to line."""

from math import pi

import pytest

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.modal import CutMove, Dwell, GcodeAction, HomeMove, OutputWord, RapidMove, actions
from tests.host.complaints import complaint_of

START = (5.0, 0.0, 0.0, 0.0)
HOME = (100.0, 0.0, 50.0, 0.0)


def made(text: str) -> list[GcodeAction]:
    return list(actions(read_blocks(text).blocks, START, HOME))


def cuts(text: str) -> list[CutMove]:
    return [each for each in made(text) if isinstance(each, CutMove)]


def test_motion_feed_and_distances_hold() -> None:
    first, second, third = cuts("G1 X10 F600\nY5\nG91 X-2 Z1 A30")
    assert (first.start, first.goal, first.feed_mm_s) == (START, (10.0, 0.0, 0.0, 0.0), 10.0)
    assert second.goal == (10.0, 5.0, 0.0, 0.0)
    assert third.goal == (8.0, 5.0, 1.0, 30.0)
    assert [move.line for move in (first, second, third)] == [1, 2, 3]


def test_inches_scale_places_feeds_and_corners() -> None:
    (move,) = cuts("G20 G64 P0.1\nG1 X1 F60")
    assert move.goal[0] == pytest.approx(25.4)
    assert move.feed_mm_s == pytest.approx(25.4)
    assert move.corner.passes_mm == pytest.approx(2.54)


@pytest.mark.parametrize(
    ("line", "sweep_rad"),
    [
        ("G3 X0 Y5 I-5 J0", pi / 2),
        ("G2 X0 Y5 I-5 J0", -3 * pi / 2),
        ("G3 X0 Y5 R5", pi / 2),
        ("G3 X0 Y5 R-5", 3 * pi / 2),
        ("G3 X5 Y0 I-5", 2 * pi),
        ("G90.1 G3 X0 Y5 I0 J0", pi / 2),
    ],
)
def test_arcs_by_centre_and_radius(line: str, sweep_rad: float) -> None:
    (move,) = cuts(f"F600\n{line}")
    assert move.arc is not None
    assert move.arc.sweep_rad == pytest.approx(sweep_rad)
    if "R-" not in line:
        assert (move.arc.x_mm, move.arc.y_mm) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_stops_home_and_outputs() -> None:
    text = "G0 X1\nM3 S500\nM62 P2\nG1 X2 F60\nM5\nG4 P1.5\nM7\nM8\nM9\nM65 P3\nM63 P2\nG28\nM0\nM2"
    assert made(text) == [
        RapidMove(1, (1.0, 0.0, 0.0, 0.0)),
        OutputWord(2, "M3", on=True),
        CutMove(4, (1.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0), 1.0, cuts("G1 X9 F1")[0].corner, None, (("P2", True),)),
        OutputWord(5, "M3", on=False),
        Dwell(6, 1.5),
        OutputWord(7, "M7", on=True),
        OutputWord(8, "M8", on=True),
        OutputWord(9, "M7", on=False),
        OutputWord(9, "M8", on=False),
        OutputWord(10, "P3", on=False),
        OutputWord(12, "P2", on=False),
        HomeMove(12),
        Dwell(13, 0.0),
        Dwell(14, 0.0),
    ]


def test_a_spindle_without_speed_stands() -> None:
    assert made("M3 S0\nS100\nS0\nG0 X1") == [
        OutputWord(2, "M3", on=True),
        OutputWord(3, "M3", on=False),
        RapidMove(4, (1.0, 0.0, 0.0, 0.0)),
    ]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("X1", "X1: no motion holds: G0, G1, G2 or G3 is missing"),
        ("G1 X1", "G1: F is missing, the feed in mm a minute"),
        ("G1 X1 F0", "F0: a feed is above 0"),
        ("G1 X1 I2 F1", "I2: goes with G2 and G3, not with G1"),
        ("G2 X1 F1", "G2: an arc has I and J, or R"),
        ("G2 X1 I1 R2 F1", "I: beside R; an arc has a centre or a radius"),
        ("G2 X1 I0 J0 F1", "G2: the centre is where the arc begins"),
        ("G2 X9 I-5 F1", "G2: the arc begins 5 mm and ends 9 mm from its centre"),
        ("G2 X-5 R4 F1", "R4: is less than half the distance of the arc's ends, 5"),
        ("G4", "G4: P is missing"),
        ("G4 P-1", "P-1: is below 0"),
        ("G0 X1 P1", "P1: no word of the line takes it"),
        ("G64 P1 M62", "P: both M62 and G64 take it; write them in two lines"),
        ("G61 Q1", "Q1: goes with G64, and is not below 0"),
        ("G28 X1", "G28: beside X"),
        ("M62 P1.5", "P1.5: the number of an output is whole"),
        ("G1 A1 C2 F1", "C: beside A; the tool has one turn"),
        ("M3 S-1", "S-1: a speed is not below 0"),
    ],
)
def test_words_that_do_not_fit_together(line: str, message: str) -> None:
    text = complaint_of(lambda: made(f"G21\n{line}"))
    assert text.startswith(f"line 2: {message}"), text
