"""The picture of a workspace is drawn, says what it shows, and is true to scale."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.robots import load_robot
from steptwin.host.robots.workspace import MonteCarlo, Scan, monte_carlo, scan

pytest.importorskip("matplotlib")

from steptwin.host.record.plots.canvas import DOTS_PER_INCH, WIDTH_INCHES
from steptwin.host.record.plots.workspace import draw_workspace, draw_workspace_3d, write_workspace
from tests.host.record.plots.drawn import drawn_points
from tests.host.record.plots.png import pixels


@cache
def workspace_of(robot: str, samples: int = 1000) -> tuple[MonteCarlo, Scan]:
    loaded = load_robot(robot)
    return monte_carlo(loaded, samples, 1), scan(loaded, 90.0)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["lab-scara", "warehouse-scara"])
def test_it_says_what_it_shows(robot: str) -> None:
    figure = draw_workspace(load_robot(robot), *workspace_of(robot))
    assert figure.get_suptitle() == f"{robot} · workspace (COMPUTED)"
    above, beside = figure.axes
    assert (above.get_xlabel(), above.get_ylabel()) == ("x [mm]", "y [mm]")
    assert (beside.get_xlabel(), beside.get_ylabel()) == ("radius about the arm's axis at home [mm]", "z [mm]")
    assert above.get_title(loc="left").startswith("from above; boundary at z = ")
    assert beside.get_title(loc="left").startswith("from the side; boundary at azimuth ")
    slides = ", sx = 0 mm, sz = 0 mm" if robot == "warehouse-scara" else ""
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "positions of random joints, 1000 of 1000",
        f"scanned boundary, attitude 90 deg{slides}",
        "arm at home",
    ]


@pytest.mark.slow
def test_it_is_true_to_scale_and_shows_cloud_and_boundary() -> None:
    cloud, scanned = workspace_of("lab-scara")
    above, beside = draw_workspace(load_robot("lab-scara"), cloud, scanned).axes
    assert above.get_aspect() == beside.get_aspect() == 1.0
    np.testing.assert_array_equal(above.lines[0].get_xydata(), cloud.cloud_mm[:, :2])
    np.testing.assert_array_equal(above.lines[1].get_xydata(), scanned.plan.boundary_mm)
    np.testing.assert_array_equal(beside.lines[1].get_xydata(), scanned.profile.boundary_mm)


def test_the_arm_stands_at_home() -> None:
    """Lift 150 mm, th2 = 0, th3 = 30 deg: the elbow is 400 mm along y; the tip is the profile's radius away."""
    above, beside = draw_workspace(load_robot("lab-scara"), *workspace_of("lab-scara")).axes
    (first_link,) = (line for line in above.lines if line.get_label() == "arm at home")
    assert drawn_points(first_link) == pytest.approx(np.array([[0.0, 0.0], [0.0, 400.0]]), abs=1e-9)
    tip = (800.0 * np.cos(np.deg2rad(15.0)), 0.0)
    assert drawn_points(beside.lines[-1])[-1] == pytest.approx(tip, abs=1e-9)


def test_the_cloud_in_space_has_equal_scales() -> None:
    cloud, _ = workspace_of("lab-scara")
    figure = draw_workspace_3d(load_robot("lab-scara"), cloud)
    axes: Any = figure.axes[0]  # matplotlib's stubs know no axes in space
    points, *parts = axes.lines
    np.testing.assert_array_equal(drawn_points(points), cloud.cloud_mm)
    assert drawn_points(parts[-1])[-1] == pytest.approx([-200.0, 746.410162, 0.0], abs=1e-5)
    widths = [np.ptp(limits()) for limits in (axes.get_xlim, axes.get_ylim, axes.get_zlim)]
    assert np.array(widths) / axes.get_box_aspect() == pytest.approx(np.full(3, widths[0] / axes.get_box_aspect()[0]))


def test_wide_views_are_stacked() -> None:
    above, beside = draw_workspace(load_robot("warehouse-scara"), *workspace_of("warehouse-scara")).axes
    assert above.get_position().y0 > beside.get_position().y0
    above, beside = draw_workspace(load_robot("lab-scara"), *workspace_of("lab-scara")).axes
    assert above.get_position().x0 < beside.get_position().x0


@pytest.mark.slow
def test_nothing_within_reach() -> None:
    loaded = load_robot("hybrid-arm")
    figure = draw_workspace(loaded, monte_carlo(loaded, 1, 2), scan(loaded, 0.0, 900.0))
    assert [text.get_text() for text in figure.axes[0].texts] == ["nothing within reach"]
    assert not figure.axes[1].texts


@pytest.mark.slow
def test_the_same_workspace_gives_the_same_picture(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("first.png", "second.png")]
    for path in paths:
        write_workspace(path, load_robot("lab-scara"), *workspace_of("lab-scara"))
    width, height = pixels(paths[0])
    assert width == WIDTH_INCHES * DOTS_PER_INCH
    assert 200 <= height <= 2 * width
    assert paths[0].read_bytes() == paths[1].read_bytes()
