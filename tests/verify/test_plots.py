"""The pictures: that they are drawn for every kind of run, say what they show, and lose no peak."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from host.trajectory import FloatArray
from host.verify import Comparison, compare
from tests.verify.motions import RUN, altered, line, motion, perfect_evidence, plan_of, sines, still, trapezoid

pytest.importorskip("matplotlib")

from host.plots import PICTURES, write_plots
from host.plots.canvas import DOTS_PER_INCH, WIDTH_INCHES, thinned

PNG_HEADER = b"\x89PNG\r\n\x1a\n"


def swinging() -> Comparison:
    """Two axes that move, one of them to and fro, and one that stands."""
    plan = plan_of(
        motion(2.0, sines([(20.0, 3.0, 0.0)]), trapezoid(3.0, -50.0, 2.0, 0.5), still(7.5)), 80.0, 40.0, 10.0
    )
    return compare(plan, perfect_evidence(plan))


def standing() -> Comparison:
    plan = plan_of(motion(1.0, still(1.0), still(2.0)), 10.0, 10.0)
    return compare(plan, perfect_evidence(plan))


def single_step() -> Comparison:
    plan = plan_of(motion(1.0, line(0.0, 0.7)), 1.0)
    return compare(plan, perfect_evidence(plan))


def silent() -> Comparison:
    """A board that made nothing of its plan."""
    plan = swinging().plan
    none, no_signs = np.empty(0, np.int64), np.empty(0, np.int8)
    evidence = perfect_evidence(plan)
    for axis in range(2):
        evidence = altered(
            evidence,
            axis,
            clk_rise_counts=none,
            clk_fall_counts=none,
            dir_edge_counts=none,
            dir_levels=no_signs,
            step_counts=none,
            step_signs=no_signs,
        )
    return compare(plan, evidence)


def dense() -> Comparison:
    """More steps than a picture has columns: drawn thinned."""
    plan = plan_of(motion(4.0, sines([(200.0, 2.0, 0.0)]), sines([(200.0, 2.0, 1.5)])), 80.0, 80.0)
    return compare(plan, perfect_evidence(plan))


RUNS = {run.__name__: run for run in (swinging, standing, single_step, silent, dense)}


def pixels(path: Path) -> tuple[int, int]:
    """Width and height from a PNG's first chunk."""
    data = path.read_bytes()
    assert data[:8] == PNG_HEADER
    assert data[12:16] == b"IHDR"
    width, height = struct.unpack(">II", data[16:24])
    return width, height


@pytest.mark.parametrize("run", RUNS)
def test_all_pictures_of_a_run_are_written(run: str, tmp_path: Path) -> None:
    paths = write_plots(tmp_path / "made" / "on demand", RUNS[run](), RUN)
    assert [path.name for path in paths] == [
        "joints.png", "step-rates.png", "tool-path.png", "error.png", "timing.png",
    ]  # fmt: skip
    for path in paths:
        width, height = pixels(path)
        assert width == WIDTH_INCHES * DOTS_PER_INCH
        assert 200 <= height <= 4 * width
        assert path.stat().st_size > 5_000


@pytest.mark.parametrize("picture", PICTURES)
def test_a_picture_says_what_it_shows(picture: str) -> None:
    figure = PICTURES[picture](swinging(), RUN)
    assert figure.get_suptitle().startswith("test-arm · test · ")
    assert figure.get_suptitle().endswith("(SIMULATED)")
    for axes in figure.axes:
        label = axes.get_ylabel()
        close_view = axes.get_title(loc="left").startswith("ms around")  # with the unit of its neighbour
        assert "[" in label or label == "DIR" or close_view or not axes.axison


@pytest.mark.parametrize("picture", ["joints.png", "step-rates.png", "error.png", "timing.png"])
def test_joints_without_motion_are_a_note(picture: str) -> None:
    figure = PICTURES[picture](swinging(), RUN)
    assert figure.get_supxlabel() == "Not shown, because without motion: c at 7.5 deg"
    names = {axes.get_ylabel().split(" ")[0] for axes in figure.axes}
    assert {"a", "b"} <= names
    assert "c" not in names


def test_one_row_a_moving_joint() -> None:
    comparison = swinging()
    rows = {name: len(draw(comparison, RUN).axes) for name, draw in PICTURES.items()}
    assert rows == {"joints.png": 4, "step-rates.png": 4, "tool-path.png": 3, "error.png": 8, "timing.png": 2}


def test_the_third_coordinate_gets_a_view_if_it_moves() -> None:
    comparison = swinging()

    def lifted(joints: FloatArray) -> FloatArray:
        return np.column_stack([joints[:, 0], joints[:, 1], joints[:, 1] / 2.0, joints[:, 2]])

    plan = replace(comparison.plan, forward=lifted)
    assert len(PICTURES["tool-path.png"](compare(plan, comparison.evidence), RUN).axes) == 6


def test_the_same_run_gives_the_same_picture(tmp_path: Path) -> None:
    first = write_plots(tmp_path / "first", swinging(), RUN)
    second = write_plots(tmp_path / "second", swinging(), RUN)
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_thinning_keeps_every_groups_extremes() -> None:
    t_s = np.arange(100_003, dtype=np.float64)
    values = np.random.default_rng(2).normal(size=t_s.size)
    values[12_345] = 50.0
    values[-1] = -50.0
    thin_s, thin = thinned(t_s, values, groups=500)
    assert len(thin) <= 2 * 500 + 500
    assert (thin.max(), thin.min()) == (50.0, -50.0)
    assert (np.diff(thin_s) > 0).all()
    np.testing.assert_array_equal(values[thin_s.astype(int)], thin)


def test_short_series_are_left_alone() -> None:
    t_s = np.linspace(0.0, 1.0, 100)
    assert thinned(t_s, t_s)[0] is t_s
