"""The markup of a replay: what its pictures and tables show, that it is well-formed, and that names are escaped."""

import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from steptwin.features.view.marks import MarkKind, RunMark
from steptwin.features.view.markup import (
    MARK_COLOURS,
    WIDTH,
    currents_picture,
    joint_table,
    pins_picture,
    strip_picture,
)
from steptwin.features.view.model import Apart, Edge, Instant, JointRow, Lane, Span
from steptwin.host.robots.poses import SCARA

SPAN = Span(1000, 2000)
STEP = Lane("th1", "step", np.array([1000, 1250, 1300]), np.array([0, 1, 0]), 2)
CROWDED = Lane("<b>", "step", np.array([1000]), np.array([1]), 12_345)
HOSTILE = '<script>alert("1")</script>'


def parsed(markup: str) -> ET.Element:
    """Return markup as a tree; it must be well-formed."""
    return ET.fromstring(f"<div>{markup}</div>")


def lines(markup: str) -> list[str]:
    return re.findall(r'<path d="([^"]*)"', markup)


def test_a_lane_follows_its_levels() -> None:
    markup = pins_picture([STEP], SPAN, 1500)
    course, cursor = lines(markup)
    assert course == f"M0.00 18.00H250.00V4.00H300.00V18.00H{WIDTH}"
    assert cursor == "M500.00 0V22"
    assert "th1 STEP" in "".join(parsed(markup).itertext())


def test_a_crowded_lane_says_how_many_changes_it_has() -> None:
    markup = pins_picture([STEP, CROWDED], SPAN, 1000)
    texts = "".join(parsed(markup).itertext())
    assert "12345 changes: a shorter window shows them" in texts
    assert "<b> STEP" in texts


def test_currents_are_to_scale() -> None:
    first = Lane("th1", "phase_a_ma", np.array([1000, 1500]), np.array([0, 1500]), 1)
    second = Lane("th1", "phase_b_ma", np.array([1000]), np.array([-1500]), 0)
    markup = currents_picture((first, second), SPAN, 1500)
    assert parsed(markup) is not None
    _, a, b, _ = lines(markup)
    assert a == f"M0.00 54.00H500.00V4.00H{WIDTH}"
    assert b == f"M0.00 104.00H{WIDTH}"
    assert "1.5 A" in markup
    assert "12345 changes" in currents_picture((first, replace(CROWDED, axis="th1")), SPAN, 1500)


def test_the_strip_shows_the_largest_value_of_each_column_and_every_mark() -> None:
    t_s = np.linspace(0.0, 10.0, 5001)
    values = np.zeros(5001)
    values[2500] = 7.0
    marks = [
        (2.5, RunMark(MarkKind.ERROR, 0, 0, HOSTILE, "x")),
        (5.0, RunMark(MarkKind.VIOLATION, 0, 72_000_000, "a", "b")),
    ]
    markup = strip_picture(t_s, values, (0.0, 10.0), marks)
    tree = parsed(markup)
    heights = [float(y) for y in re.findall(r"L[\d.]+ ([\d.]+)", lines(markup)[0])]
    assert min(heights) == 14.0
    assert heights.count(48.0) == len(heights) - 1
    rectangles = [rect.attrib for rect in tree.iter("rect")]
    assert [(rect["x"], rect["width"], rect["fill"]) for rect in rectangles] == [
        ("248.5", "3.0", MARK_COLOURS[MarkKind.ERROR]),
        ("498.5", "100.0", MARK_COLOURS[MarkKind.VIOLATION]),
    ]
    assert "<script" not in markup


@pytest.mark.parametrize("values", [np.zeros(10), np.empty(0)])
def test_a_strip_without_errors(values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> None:
    assert parsed(strip_picture(np.linspace(0.0, 1.0, values.size), values, (0.0, 1.0), [])) is not None


def shown(counted: float) -> Instant:
    row = JointRow(HOSTILE, "mm", 1.0, counted, 40, -0.25)
    edge = Edge(1, "a", "step", 1)
    return Instant(0, (row,), SCARA, (1.0, 2.0, 3.0, 4.0), (counted, 2.0, 3.0, 4.0), 0.5, edge, edge)


def test_the_table_of_one_run_and_of_two() -> None:
    one = joint_table([shown(1.5)], None)
    cells = [cell.text for cell in parsed(one).iter("td")]
    assert cells[:6] == [HOSTILE, "mm", "1.0000", "1.5000", "-0.250", "40"]
    assert cells[6:10] == ["x", "mm", "1.0000", "1.5000"]
    assert "0.5000 mm" in one
    two = joint_table([shown(1.5), shown(2.0)], Apart({HOSTILE: 0.5}, 0.5, -1.0))
    cells = [cell.text for cell in parsed(two).iter("td")]
    assert cells[:5] == [HOSTILE, "mm", "1.5000", "2.0000", "+0.5000"]
    assert cells[5:10] == ["x", "mm", "1.5000", "2.0000", "+0.5000"]
    assert cells[-5:] == ["phi", "deg", "4.0000", "4.0000", "-1.0000"]
