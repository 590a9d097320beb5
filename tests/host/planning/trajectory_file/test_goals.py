"""A message of ROS whose first point comes after 0 s: the machine goes there from its home position."""

import json
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.planning.trajectory_file import read_file_motion
from steptwin.host.robots import load_robot

ROBOT = load_robot("teaching-scara")


def written(
    folder: Path, *points: tuple[float, list[float]], names: tuple[str, ...] = ("d3", "th1", "th2", "th4")
) -> Path:
    path = folder / "goal.json"
    rows = [{"positions": at, "time_from_start": {"sec": int(t_s), "nanosec": 0}} for t_s, at in points]
    path.write_text(json.dumps({"joint_names": names, "points": rows}), encoding="utf-8")
    return path


def test_one_point_is_a_motion_from_home(tmp_path: Path) -> None:
    found = read_file_motion(written(tmp_path, (2, [5.0, 10.0, 20.0, 0.0])), ROBOT)
    places = found.whole.positions(np.array([0.0, 2.0]))
    assert found.whole.duration_s == 2.0
    assert places[0] == pytest.approx(ROBOT.home)
    assert places[1] == pytest.approx([10.0, 20.0, 5.0, 0.0])
    assert found.points.begun_at_home


def test_a_first_point_at_0_s_begins_there(tmp_path: Path) -> None:
    found = read_file_motion(written(tmp_path, (0, [5.0, 1.0, 2.0, 0.0]), (2, [5.0, 10.0, 20.0, 0.0])), ROBOT)
    assert found.points.positions[0] == pytest.approx([1.0, 2.0, 5.0, 0.0])
    assert not found.points.begun_at_home


def test_no_points_and_other_columns_are_refused_as_ever(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="0 points: a motion takes at least 2"):
        read_file_motion(written(tmp_path), ROBOT)
    with pytest.raises(InputError, match="point 1, time_from_start: 2 s, but the first point is at 0 s"):
        read_file_motion(
            written(
                tmp_path, (2, [130.0, 0.0, -50.0, 0.0]), (3, [130.0, 0.0, -40.0, 0.0]), names=("x", "y", "z", "phi")
            ),
            ROBOT,
        )


@pytest.mark.slow
def test_the_command_says_where_it_begins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, (2, [5.0, 10.0, 20.0, 0.0]))
    assert run(["run", "teaching-scara", str(path)]) == 0
    assert f"{path}: begins at the robot's home position, 2 s before the first point" in capsys.readouterr().out
