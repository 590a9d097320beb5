"""Tool paths of G-code: where they pass corners, where they stop, and what becomes of nearly straight lines."""

from itertools import pairwise
from math import hypot, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.cut_runs import CutRun, Placing, cut_runs
from steptwin.features.gcode.modal import CutMove, actions
from steptwin.host.common.arrays import FloatArray

PLACING = Placing(np.zeros(3), np.eye(3), 0.0, (), 4)
START = (0.0, 0.0, 0.0, 0.0)


def runs(text: str, blend_mm: float = 0.0, placing: Placing = PLACING) -> list[CutRun]:
    moves = [each for each in actions(read_blocks(text).blocks, START, START) if isinstance(each, CutMove)]
    return cut_runs(moves, placing, blend_mm)


def places(run: CutRun, apart_mm: float = 0.01) -> FloatArray:
    length = run.contour.length_mm
    return run.contour.poses(np.linspace(0.0, length, round(length / apart_mm) + 2))[:, :3]


CORNER = "G1 X10 F600\nY10"


def test_a_corner_is_passed_at_the_distance_of_g64() -> None:
    (run,) = runs(f"G64 P0.1\n{CORNER}")
    off = np.linalg.norm(places(run) - [10.0, 0.0, 0.0], axis=1)
    assert off.min() == pytest.approx(0.1, abs=1e-4)
    r_mm = 0.1 / (3 / 16 * sqrt(2))
    before = places(run)[:, 0] < 10.0 - r_mm - 1e-9
    assert np.abs(places(run)[before, 1]).max() < 1e-12  # on the line until there


def test_without_a_distance_the_programs_rounding_holds_and_at_most_half_a_leg() -> None:
    (run,) = runs(CORNER, blend_mm=2.0)
    assert np.linalg.norm(places(run) - [10.0, 0, 0], axis=1).min() == pytest.approx(3 / 16 * 2.0 * sqrt(2), abs=1e-4)
    (wide,) = runs(CORNER, blend_mm=50.0)
    assert np.linalg.norm(places(wide) - [10.0, 0, 0], axis=1).min() == pytest.approx(3 / 16 * 5.0 * sqrt(2), abs=1e-4)


@pytest.mark.parametrize(("head", "count"), [("G61", 2), ("G64 P0.1", 1), ("G64", 2)])
def test_exact_stops_and_corners_without_any_rounding(head: str, count: int) -> None:
    found = runs(f"{head}\n{CORNER}")
    assert len(found) == count
    assert found[-1].contour.poses(np.array([found[-1].contour.length_mm]))[0] == pytest.approx([10, 10, 0, 0])


@pytest.mark.parametrize(("kink_deg", "count"), [(0.09, 1), (0.11, 2)])
def test_exact_stop_mode_flows_on_where_there_is_hardly_a_corner(kink_deg: float, count: int) -> None:
    y = 10 * np.tan(np.deg2rad(kink_deg))
    assert len(runs(f"G61\nG1 X10 F600\nX20 Y{y:.6f}")) == count


def test_a_tangential_arc_flows_without_a_rounding() -> None:
    (run,) = runs("G61\nG1 X10 F600\nG3 X15 Y5 J5\nG1 Y10")
    assert int(run.contour.roundings.sum()) == 0
    arc = places(run)[(places(run)[:, 0] > 10.0) & (places(run)[:, 1] < 5.0)]
    assert np.hypot(arc[:, 0] - 10.0, arc[:, 1] - 5.0) == pytest.approx(5.0, abs=1e-9)
    assert run.contour.length_mm == pytest.approx(10.0 + 5.0 * np.pi / 2 + 5.0)


def test_a_helix_climbs_evenly() -> None:
    (run,) = runs("F600\nG3 X0 Y0 Z3 I5")
    found = places(run)
    assert found[-1] == pytest.approx([0, 0, 3], abs=1e-9)
    assert run.contour.length_mm == pytest.approx(hypot(2 * np.pi * 5, 3))
    assert np.diff(found[:, 2]).max() == pytest.approx(np.diff(found[:, 2]).min())


@pytest.mark.parametrize(("q_mm", "pieces"), [(0.02, 1), (0.005, 3)])
def test_nearly_straight_lines_are_merged(q_mm: float, pieces: int) -> None:
    """Points 0.01 mm off a line: one line for a distance of 0.02, and each its own for 0.005."""
    (run,) = runs(f"G64 P0.5 Q{q_mm}\nG1 X10 Y0.01 F600\nX20 Y-0.01\nX30 Y0")
    assert len(run.moves) == pieces
    assert run.moves[-1].goal == (30.0, 0.0, 0.0, 0.0)


def test_another_feed_or_an_output_keeps_lines_apart() -> None:
    (run,) = runs("G64 P0.5 Q0.1\nG1 X10 F600\nX20 F700\nM62 P1\nX30")
    assert [move.feed_mm_s for move in run.moves] == pytest.approx([10.0, 700 / 60, 700 / 60])
    assert run.begins_mm.tolist() == pytest.approx([0.0, 10.0, 20.0])


def test_a_frame_turns_and_shifts_the_path() -> None:
    quarter = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # rows: where the file's axes lead
    placing = Placing(np.array([100.0, 20, 5]), quarter, 90.0, (), 4)
    (run,) = runs("G1 X10 F600", placing=placing)
    ends = run.contour.poses(np.array([0.0, run.contour.length_mm]))
    assert ends == pytest.approx(np.array([[100.0, 20, 5, 90], [100, 30, 5, 90]]))
    assert placing.spot(ends[1].tolist()) == pytest.approx((10, 0, 0, 0))


steps = st.tuples(st.integers(-900, 900), st.integers(-900, 900)).filter(lambda way: max(map(abs, way)) >= 50)


@pytest.mark.slow
@settings(max_examples=60)
@given(st.lists(steps, min_size=2, max_size=12), st.integers(1, 30), st.integers(0, 20))
def test_the_path_stays_by_its_lines(ways: list[tuple[int, int]], p: int, q: int) -> None:
    """Never farther from the lines as written than both distances together: the rounding's and the merging's."""
    corners = np.cumsum([(0, 0), *ways], axis=0) / 100
    lines = "\n".join(f"G1 X{x:.2f} Y{y:.2f}" for x, y in corners[1:])
    found = runs(f"F600\nG64 P{p / 100} Q{q / 100}\n{lines}")
    for run in found:
        off = np.min([_off(places(run, 0.1)[:, :2], a, b) for a, b in pairwise(corners)], axis=0)
        assert off.max() <= p / 100 + q / 100 + 1e-6
    ends = [run.contour.poses(np.array([0.0, run.contour.length_mm]))[:, :2] for run in found]
    assert ends[0][0] == pytest.approx(corners[0], abs=1e-9)
    assert ends[-1][1] == pytest.approx(corners[-1], abs=1e-9)
    for before, after in pairwise(ends):
        assert before[1] == pytest.approx(after[0], abs=1e-9)


def _off(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    way = b - a
    part = np.clip((points - a) @ way / (way @ way), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - part[:, np.newaxis] * way, axis=1))
