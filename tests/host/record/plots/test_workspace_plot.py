"""The picture of a workspace is drawn, says what it shows, and is true to scale."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.robots import load_robot
from steptwin.host.robots.workspace import MonteCarlo, Scan, monte_carlo, scan

pytest.importorskip("matplotlib")

from steptwin.host.record.plots.canvas import DOTS_PER_INCH, WIDTH_INCHES
from steptwin.host.record.plots.workspace import draw_workspace, write_workspace
from tests.host.record.plots.png import pixels


@cache
def workspace_of(robot: str, samples: int = 1000) -> tuple[MonteCarlo, Scan]:
    loaded = load_robot(robot)
    return monte_carlo(loaded, samples, 1), scan(loaded, 90.0)


@pytest.mark.parametrize("robot", ["lab-scara", "warehouse-scara"])
def test_it_says_what_it_shows(robot: str) -> None:
    figure = draw_workspace(robot, *workspace_of(robot))
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
    ]


def test_it_is_true_to_scale_and_shows_cloud_and_boundary() -> None:
    cloud, scanned = workspace_of("lab-scara")
    above, beside = draw_workspace("lab-scara", cloud, scanned).axes
    assert above.get_aspect() == beside.get_aspect() == 1.0
    np.testing.assert_array_equal(above.lines[0].get_xydata(), cloud.cloud_mm[:, :2])
    np.testing.assert_array_equal(above.lines[1].get_xydata(), scanned.plan.boundary_mm)
    np.testing.assert_array_equal(beside.lines[1].get_xydata(), scanned.profile.boundary_mm)


def test_wide_views_are_stacked() -> None:
    above, beside = draw_workspace("warehouse-scara", *workspace_of("warehouse-scara")).axes
    assert above.get_position().y0 > beside.get_position().y0
    above, beside = draw_workspace("lab-scara", *workspace_of("lab-scara")).axes
    assert above.get_position().x0 < beside.get_position().x0


def test_nothing_within_reach() -> None:
    loaded = load_robot("hybrid-arm")
    figure = draw_workspace("hybrid-arm", monte_carlo(loaded, 1, 2), scan(loaded, 0.0, 900.0))
    assert [text.get_text() for text in figure.axes[0].texts] == ["nothing within reach"]
    assert not figure.axes[1].texts


def test_the_same_workspace_gives_the_same_picture(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("first.png", "second.png")]
    for path in paths:
        write_workspace(path, "lab-scara", *workspace_of("lab-scara"))
    width, height = pixels(paths[0])
    assert width == WIDTH_INCHES * DOTS_PER_INCH
    assert 200 <= height <= 2 * width
    assert paths[0].read_bytes() == paths[1].read_bytes()
