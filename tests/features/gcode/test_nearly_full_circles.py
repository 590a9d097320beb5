"""Arcs whose ends nearly coincide, or are not equally far from the centre: the centre stays, and the radius grows."""

from math import hypot, pi

import numpy as np
import pytest

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.cut_runs import Placing, cut_runs
from steptwin.features.gcode.modal import CutMove, actions
from steptwin.host.common.arrays import FloatArray
from tests.host.complaints import complaint_of

START = (10.0, 0.0, 0.0, 0.0)
PLACING = Placing(np.zeros(3), np.eye(3), 0.0, (), 3)


def cut(text: str) -> CutMove:
    (move,) = (each for each in actions(read_blocks(f"F600\n{text}").blocks, START, START) if isinstance(each, CutMove))
    return move


def places(text: str) -> FloatArray:
    contour = cut_runs([cut(text)], PLACING, 0.0)[0].contour
    return contour.poses(np.linspace(0.0, contour.length_mm, 721))


@pytest.mark.parametrize(
    "off", ["X10.0000001 Y0", "X9.9999999 Y0", "Y0.0000001", "Y-0.0000001", "X10.003 Y0", "X10 Y0"]
)
@pytest.mark.parametrize("word", ["G2", "G3"])
def test_an_end_beside_the_begin_makes_a_whole_circle_about_its_centre(word: str, off: str) -> None:
    move = cut(f"{word} {off} I5")
    assert move.arc is not None
    assert (move.arc.x_mm, move.arc.y_mm) == (15.0, 0.0)
    assert move.arc.sweep_rad == pytest.approx(-2 * pi if word == "G2" else 2 * pi)
    found = places(f"{word} {off} I5")
    away = np.hypot(found[:, 0] - 15.0, found[:, 1])
    assert np.abs(away - 5.0).max() < 0.0031
    assert found[180, :2] == pytest.approx([15.0, 5.0 if word == "G2" else -5.0], abs=0.002)


def test_it_grows_evenly_from_begin_to_end() -> None:
    found = places("G3 X0 Y10.008 Z2 I-10 J0")
    away = np.hypot(found[:, 0], found[:, 1])
    assert away == pytest.approx(np.linspace(10.0, 10.008, 721), abs=1e-9)
    assert found[-1] == pytest.approx([0.0, 10.008, 2.0], abs=1e-12)
    assert found[360, 2] == pytest.approx(1.0)


def test_derivatives_are_those_of_its_places() -> None:
    contour = cut_runs([cut("G3 X0 Y10.009 Z2 I-10 J0")], PLACING, 0.0)[0].contour
    s, small = np.linspace(1.0, 14.0, 9), 1e-4
    before, after = contour.poses(s - small), contour.poses(s + small)
    piece, part = contour.place_of(s)
    assert contour.derivatives(s) == pytest.approx((after - before) / (2 * small), abs=1e-7)
    bends = (contour.derivatives(s + small) - contour.derivatives(s - small)) / (2 * small)
    assert contour.rates_of(piece, part, 2) == pytest.approx(bends, abs=1e-7)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("G2 I0.0000001", "the centre is where the arc begins, to 1e-06 mm"),
        ("G2 X10.002 I0.002", "the centre is where the arc ends, to 1e-06 mm"),
        ("G2 X10.006 I5", "begins 5 mm and ends 4.994 mm from its centre; they may differ by 0.005 mm"),
        ("G2 X-1990.6 Y0 I-1000 J0", "begins 1000 mm and ends 1000.6 mm from its centre; they may differ by 0.5 mm"),
        ("G2 X10.0000001 R5", "an arc that ends where it begins has I and J"),
        ("G2 X10.0005 R-5", "does not say where its centre is: nearly a whole circle has I and J"),
        ("G2 X12021 R1000", "is less than half the distance of the arc's ends"),
    ],
)
def test_beyond_the_tolerance_it_is_refused(text: str, told: str) -> None:
    assert told in complaint_of(lambda: cut(text))


def test_an_arc_by_its_radius_has_it_at_both_ends() -> None:
    for text, sweep in (("G3 X0 Y10 R10", pi / 2), ("G3 X0 Y10 R-10", 3 * pi / 2), ("G2 X10.01 Y0 R-5", -2 * pi)):
        arc, goal = cut(text).arc, cut(text).goal
        assert arc is not None
        ends = [hypot(each[0] - arc.x_mm, each[1] - arc.y_mm) for each in (START, goal)]
        assert ends == pytest.approx([abs(float(text.split("R")[1]))] * 2)
        assert arc.sweep_rad == pytest.approx(sweep, abs=0.003)
