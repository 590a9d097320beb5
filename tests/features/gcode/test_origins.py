"""Origins, homing, planes, feeds and dwells of G-code, by the dialect."""

from math import dist, pi

import numpy as np
import pytest

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.cut_runs import Placing, cut_runs
from steptwin.features.gcode.dialects import Dialect
from steptwin.features.gcode.modal import (
    CornerMode,
    CutMove,
    Dwell,
    GcodeAction,
    HomeMove,
    RapidMove,
    actions,
)
from tests.host.complaints import complaint_of

K, M, G, H, L = Dialect
HOME = (100.0, 90.0, 50.0, 0.0)
START = (5.0, 6.0, 7.0, 0.0)
USUAL = CornerMode(passes_mm=0.05)


def made(text: str, dialect: Dialect | None = None) -> list[GcodeAction]:
    found = read_blocks(text, dialect)
    return actions(found.blocks, START, HOME, found.manners, USUAL if dialect else None)


def goals(text: str, dialect: Dialect | None = None) -> list[tuple[float, ...]]:
    return [each.goal[:3] for each in made(text, dialect) if isinstance(each, RapidMove | CutMove)]


def end(text: str, dialect: Dialect | None = None) -> tuple[float, ...]:
    return goals(text, dialect)[-1]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("G92 X0 Z1\nG0 X2 Z1", (7.0, 6.0, 7.0)),
        ("G92 X0\nG92.1\nG0 X2", (2.0, 6.0, 7.0)),
        ("G92 X0\nG92.2\nG0 X2", (2.0, 6.0, 7.0)),
        ("G92 X0\nG92.2\nG92.3\nG0 X2", (7.0, 6.0, 7.0)),
        ("G92 X0\nG92.1\nG92.3\nG0 X2", (2.0, 6.0, 7.0)),
        ("G20 G92 X0\nG0 X1", (30.4, 6.0, 7.0)),
        ("G92 X0\nG91 G0 X2", (7.0, 6.0, 7.0)),
        ("G52 X10\nG0 X2", (12.0, 6.0, 7.0)),
        ("G52 X10\nG52 X0\nG0 X2", (2.0, 6.0, 7.0)),
        ("G10 L2 P2 X10 Y20\nG0 X2\nG55 X2 Y0", (12.0, 20.0, 7.0)),
        ("G10 L2 P0 X10 R0\nG0 X2", (12.0, 6.0, 7.0)),
        ("G10 L2 P1 X10\nG10 L2 P9 Z3\nG59.3 G0 X2 Z0", (2.0, 6.0, 3.0)),
        ("G10 L20 P1 X1 Z0\nG0 X2 Z1", (6.0, 6.0, 8.0)),
        ("G92 X0\nG10 L20 P0 X1\nG0 X2", (6.0, 6.0, 7.0)),
        ("G10 L2 P1 X10\nG92 X0\nG0 X1\nG53 G0 X1", (1.0, 6.0, 7.0)),
        ("G10 L2 P1 X10\nG53 G0 Z1\nX0", (10.0, 6.0, 1.0)),
        ("G43.1 Z10\nG0 Z1", (5.0, 6.0, 11.0)),
        ("G43.1 Z10\nG49\nG0 Z1", (5.0, 6.0, 1.0)),
        ("G43.1 Z10\nG92 Z0\nG0 Z1", (5.0, 6.0, 8.0)),
        ("G43.1 Z10\nG10 L20 P1 Z0\nG49 G0 Z1", (5.0, 6.0, -2.0)),
    ],
)
def test_origins_move(text: str, place: tuple[float, float, float]) -> None:
    assert end(text) == pytest.approx(place)
    assert end(text, L) == pytest.approx(place)


def test_homing_of_printers_ends_the_offset_of_its_axes() -> None:
    assert made("G28", K) == [HomeMove(1)]
    assert goals("G28 X Z\nG1 X1", M) == [(100.0, 6.0, 50.0), (1.0, 6.0, 50.0)]
    assert end("G92 X0 Y0\nG28 X0\nG1 X1 Y1", K) == (1.0, 7.0, 7.0)
    assert end("G92 X0 Y0\nG28\nG1 X1 Y1", M) == (1.0, 1.0, 50.0)


def test_homing_of_mills_goes_where_its_words_lead_first() -> None:
    assert made("G28", G) == [HomeMove(1)]
    assert made("$H", G) == [HomeMove(1)]
    assert goals("G91 G28 Z2", L) == [(5.0, 6.0, 9.0), (5.0, 6.0, 50.0)]
    assert goals("G28 X1 Y2", G) == [(1.0, 2.0, 7.0), (100.0, 90.0, 7.0)]
    assert goals("G0 X1\nG30.1\nG0 X2\nG30", H) == [(1.0, 6.0, 7.0), (2.0, 6.0, 7.0), (1.0, 6.0, 7.0)]
    assert made("G30", L) == [HomeMove(1)]
    assert goals("G28.1\nG92 X0\nG0 X9\nG28", L)[-1] == START[:3]


@pytest.mark.parametrize(
    ("dialect", "word", "time_s"),
    [
        (None, "P2", 2.0),
        (K, "P500", 0.5),
        (M, "P500", 0.5),
        (M, "S2", 2.0),
        (G, "P2", 2.0),
        (H, "P2", 2.0),
        (L, "P2", 2.0),
    ],
)
def test_a_dwell_is_in_the_dialects_unit(dialect: Dialect | None, word: str, time_s: float) -> None:
    assert made(f"G4 {word}", dialect) == [Dwell(1, time_s)]


def test_a_dwell_comes_before_the_motion_of_its_line() -> None:
    assert made("G4 P1 G0 X2", L) == [Dwell(1, 1.0), RapidMove(1, (2.0, 6.0, 7.0, 0.0))]
    assert complaint_of(lambda: made("G4 P1 G0 X2")) == "line 1: G4: beside X; it stands without motion words"


def feeds(text: str, dialect: Dialect | None = None) -> list[float]:
    return [each.feed_mm_s for each in made(text, dialect) if isinstance(each, CutMove)]


def test_feeds_of_printers() -> None:
    assert feeds("G0 X1\nG1 X2 F600\nG0 X3", K) == [25.0, 10.0, 10.0]
    assert feeds("G1 X2 F600\nM220 S150\nG1 X3\nM220 S100\nG1 X4", M) == [10.0, 15.0, 10.0]
    assert [type(each) for each in made("G1 X2 F60\nG0 X3", G)] == [CutMove, RapidMove]


def test_grbl_begins_with_rapid_moves() -> None:
    assert goals("X1", G) == [(1.0, 6.0, 7.0)]
    assert complaint_of(lambda: made("X1", L)) == "line 1: X1: no motion holds: G0, G1, G2 or G3 is missing"


def test_inverse_time() -> None:
    assert feeds("G93 G1 X15 F6\nG1 X25 F3\nG2 X35 I5 F2") == pytest.approx([1.0, 0.5, 5 * pi / 30])
    assert feeds("G18 G93 G2 X15 Y16 I5 K0 F60") == pytest.approx([((5 * pi) ** 2 + 100) ** 0.5])


@pytest.mark.parametrize(
    ("text", "middle"),
    [
        ("G17 G3 X5 Y16 I0 J5", (10.0, 11.0, 7.0)),
        ("G18 G3 Z17 X5 I0 K5", (0.0, 6.0, 12.0)),
        ("G18 G2 Z17 X5 R5", (10.0, 6.0, 12.0)),
        ("G19 G3 Y16 Z7 J5", (5.0, 11.0, 2.0)),
        ("G19 G90.1 G2 Y16 J11 K7", (5.0, 11.0, 12.0)),
    ],
)
def test_half_circles_in_three_planes(text: str, middle: tuple[float, float, float]) -> None:
    moves = [each for each in made(f"F600\n{text}") if isinstance(each, CutMove)]
    (run,) = cut_runs(moves, Placing(np.zeros(3), np.eye(3), 0.0, (), 3), 0.0)
    length = float(run.contour.lengths_mm.sum())
    assert length == pytest.approx(5 * pi)
    poses = run.contour.poses(np.array([0.0, length / 2, length]))
    assert poses[:, :3] == pytest.approx(np.array([START[:3], middle, moves[0].goal[:3]]))


def test_corners_by_the_dialect() -> None:
    def corners(text: str, dialect: Dialect | None) -> list[CornerMode]:
        return [each.corner for each in made(f"F60\n{text}", dialect) if isinstance(each, CutMove)]

    assert corners("G1 X1\nG64\nX2\nG64 P0.1\nX3\nG61\nX4\nG61.1\nX5", L) == [
        USUAL,
        USUAL,
        CornerMode(passes_mm=0.1, merge_mm=0.1),
        CornerMode(is_exact=True),
        CornerMode(is_exact=True),
    ]
    assert corners("G61 G1 X1", G) == [USUAL]
    assert corners("G1 X1\nG64 X2", None) == [CornerMode(), CornerMode()]


def spline(text: str, dialect: Dialect = L) -> list[CutMove]:
    return [each for each in made(f"G92 X0 Y0\nF600\n{text}", dialect) if isinstance(each, CutMove)]


def test_a_cubic_spline_flows_and_stays_near() -> None:
    moves = spline("G5 X30 Y0 I10 J20 P-5 Q10\nX60 Y10 P-5 Q-5")
    assert [move.start for move in moves[1:]] == [move.goal for move in moves[:-1]]
    assert moves[-1].goal[:3] == pytest.approx((65.0, 16.0, 7.0))
    (run,) = cut_runs(moves, Placing(np.zeros(3), np.eye(3), 0.0, (), 3), 0.0)  # no corner, no stop
    assert not run.radii_mm.any()
    part = np.linspace(0.0, 1.0, 60)[:, np.newaxis]
    curve = np.zeros((0, 2))
    for points in ([(0, 0), (10, 20), (25, 10), (30, 0)], [(30, 0), (35, -10), (55, 5), (60, 10)]):
        a, b, c, d = np.array(points, float) + np.array([5.0, 6.0])
        rest = 1.0 - part
        curve = np.vstack([curve, rest**3 * a + 3 * rest**2 * part * b + 3 * rest * part**2 * c + part**3 * d])
    length = float(run.contour.lengths_mm.sum())
    path = run.contour.poses(np.linspace(0.0, length, 12_000))[:, :2]
    assert max(np.min(np.linalg.norm(path - place, axis=1)) for place in curve) < 0.004


def test_a_quadratic_spline_is_the_same_as_its_cubic() -> None:
    quadratic, cubic = spline("G5.1 X30 Y0 I15 J15"), spline("G5 X30 Y0 I10 J10 P-10 Q10")
    assert len(quadratic) == len(cubic)
    assert max(dist(a.goal, b.goal) for a, b in zip(quadratic, cubic, strict=True)) < 1e-9
    (line,) = {move.arc for move in spline("G5 X30 Y0 I10 J0 P-10 Q0")}
    assert line is None


@pytest.mark.parametrize(
    ("dialect", "text", "message"),
    [
        (L, "G5 X1 Y1 I1 J1 P1", "line 2: G5: P and Q are missing"),
        (L, "G5 X1 Y1 P1 Q1", "line 2: G5: I and J are missing"),
        (L, "G5.1 X1 Y1", "line 2: G5.1: I and J are missing"),
        (L, "G18 G5 X1 Y1 I1 J1 P1 Q1", "line 2: G5: a spline is in the x-y plane"),
        (L, "G5 X1 Z1 I1 J1 P1 Q1", "line 2: G5: a spline is in the x-y plane"),
        (L, "G10 L1 P1 Z1", "line 2: G10: L1 is not L2 or L20"),
        (L, "G10 P1 Z1", "line 2: G10: without L, it is not L2 or L20"),
        (L, "G10 L2 P10 Z1", "line 2: P10: a coordinate system has a number from 0 to 9"),
        (L, "G10 L2 P1 X1 R5", "line 2: R5: beside G10; coordinates are not turned"),
        (L, "G10 L2 P1", "line 2: G10: no axis word; there are X Y Z A C"),
        (L, "G92", "line 2: G92: no axis word"),
        (L, "G53 G2 X1 I1", "line 2: G53: goes with G0 and G1, in absolute places, not with G2"),
        (L, "G91 G53 G0 X1", "line 2: G53: goes with G0 and G1, in absolute places, not with G0"),
        (L, "G43.1", "line 2: G43.1: Z is missing, the tool's length"),
        (L, "G92 X1 G1", "line 2: G92: beside G1; it stands without motion words"),
        (L, "G1 X1 L2", "line 2: L2: goes with G10"),
        (L, "G18 G2 X1 I1 J1", "line 2: J1: an arc in G18 has its centre at the height of its start"),
        (L, "G19 G2 Z1 I1", "line 2: G2: an arc has J and K, or R"),
        (None, "G28 X1", "line 2: G28: beside X"),
        (G, "G93\nG1 X1 F1\nX2", "line 4: G1: F is missing; with G93 each move has its own"),
        (G, "G1 X1\nG93\nG94 G1 X2", "line 4: G1: F is missing, the feed in mm a minute"),
    ],
)
def test_what_does_not_fit_together(dialect: Dialect | None, text: str, message: str) -> None:
    told = complaint_of(lambda: made(f"F60\n{text}", dialect))
    assert told.startswith(message), told


def test_the_first_twenty_refusals_are_told_at_once() -> None:
    text = "G1 X1 F60\n" + "G2 X2\n" * 25
    found = read_blocks(text)
    with pytest.raises(Exception, match="line 2: G2: an arc has I and J, or R") as caught:
        actions(found.blocks, START, HOME)
    assert len(caught.value.messages) == 20  # type: ignore[attr-defined]
