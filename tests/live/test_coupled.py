"""A served machine whose elbow motor sits on the base, by its robot's file alone."""

from pathlib import Path

import pytest

from tests.end_to_end.served import Server, in_real_time, serving
from tests.end_to_end.test_coupled import POINTS
from tests.host.robots.coupled import coupled_text


@in_real_time
def test_home_jog_move_and_run(tmp_path: Path) -> None:
    """Home by the switches, jog the shoulder, move, run: the elbow stays where it should."""
    robot, points = str(tmp_path / "belt.toml"), str(tmp_path / "points.csv")
    Path(robot).write_text(coupled_text())
    Path(points).write_text(POINTS)

    def positions(server: Server) -> list[float]:
        return [axis["position"] for axis in server.json("status", robot)["axes"]]

    with serving(robot, "--machine", "stand-at=-120 -40 3 -340") as server:
        assert server.run("home", robot) == 0
        assert positions(server) == pytest.approx([0.0] * 4, abs=0.06)
        jogged = server.json("jog", robot, "th1", "20", "--seconds", "0.5")
        assert jogged["end"] > 5
        assert positions(server) == pytest.approx([jogged["end"], 0.0, 0.0, 0.0], abs=0.09)
        assert server.run("move", robot, "th1=0", "th2=0") == 0
        assert server.run("run", robot, points, "--approach") == 0
