"""Corners of G-code: a blended path is never slower than one that stops, and how far it is from the file's lines."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.cut_runs import Placing, cut_runs
from steptwin.features.gcode.modal import CutMove, actions
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program
from steptwin.host.robots import load_robot

GANTRY = load_robot("corexy-gantry")
HEAD = """
start = { X = 125, Y = 100, Z = 20 }
[frames.plate]
x = 125.0
y = 100.0
z = 20.0
[[step]]
gcode = "part.ngc"
frame = "plate"
feed_max_mm_s = 150
"""
STROKES = "\n".join(f"G1 Y{20 * (i % 2)} F9000\nX{0.8 * (i + 1):.1f}" for i in range(3))
"""There and back, a little beside: sharp corners with short ways between them."""
WALK = "\n".join(f"G1 X{x} Y{y} F9000" for x, y in ((4, 1), (6, -5), (1, -3), (5, 6)))


def compiled(folder: Path, text: str) -> CompiledProgram:
    (folder / "part.ngc").write_text(text, encoding="utf-8")
    found = Findings()
    program = parse_program(HEAD, found, folder)
    found.raise_first()
    return compile_program(program, GANTRY)


@pytest.mark.slow
@pytest.mark.parametrize("moves", [STROKES, WALK], ids=["strokes", "walk"])
def test_no_distance_makes_a_part_slower_than_exact_stop(moves: str, tmp_path: Path) -> None:
    exact_s = compiled(tmp_path, f"G61\n{moves}").motion.duration_s
    for p_mm in (0.3, 0.02):
        assert compiled(tmp_path, f"G64 P{p_mm}\n{moves}").motion.duration_s <= exact_s + 1e-9


@pytest.mark.slow
def test_corners_that_are_hardly_rounded_are_stops_and_a_wide_one_is_none(tmp_path: Path) -> None:
    text = "G64 P0.002\nG1 X20 F9000\nY20\nG64 P3\nX0\nY0"
    notes = compiled(tmp_path, text).steps[-1].notes[0]
    assert notes.endswith("3 paths of the tool without a stop, 1 corner rounded, 2 stops at corners")


# --- how far the path is from the lines of the file

PLACING = Placing(np.zeros(3), np.eye(3), 0.0, (), 4)


def places(head: str, lines: str) -> FloatArray:
    start = (0.0, 0.0, 0.0, 0.0)
    moves = [
        each
        for each in actions(read_blocks(f"F600\n{head}\n{lines}").blocks, start, start)
        if isinstance(each, CutMove)
    ]
    paths = [run.contour for run in cut_runs(moves, PLACING, 0.0)]
    return np.concatenate([path.poses(np.arange(0.0, path.length_mm, 0.004))[:, :2] for path in paths])


def farthest_mm(head: str, lines: str) -> float:
    return float(np.max(cKDTree(places("G61", lines)).query(places(head, lines))[0]))


@pytest.mark.parametrize("p_mm", [1.0, 0.2])
@pytest.mark.parametrize(
    "lines",
    ["G1 X8\nX3 Y5", "G1 X6\nG3 X10 Y4 R4\nG1 X2", "G2 X5 Y5 R4\nG3 X9 Y1 R5", "G1 X5\nY0.5\nX0"],
    ids=["lines", "line and arc", "arcs", "there and back"],
)
def test_without_merging_the_path_stays_within_p_of_the_lines(lines: str, p_mm: float) -> None:
    assert 0.0 < farthest_mm(f"G64 P{p_mm} Q0.000001", lines) <= p_mm + 0.005


def test_merged_lines_may_take_q_as_well() -> None:
    lines = "G1 X4.347 Y-0.101\nX10 Y0\nX10.311 Y-0.506\nX17.021 Y-7.12"
    assert 0.7 < farthest_mm("G64 P0.5", lines) < 0.5 + 0.5
    assert farthest_mm("G64 P0.25 Q0.25", lines) <= 0.5
