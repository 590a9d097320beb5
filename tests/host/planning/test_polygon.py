"""How far a motion leaves the lines between its points: by hand, and against a search over the whole polygon."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning import polygon as polygon_module
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import blended_lines, c2_spline, hermite_spline
from steptwin.host.planning.polygon import TOOL, TOOL_MM, Departure, Polygon
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics

ROBOT = load_robot("teaching-scara")
NAMES = ROBOT.joint_names
TIMES_S = np.array([0.0, 1.0, 2.0])


def points(*th1_and_d3: tuple[float, float]) -> FloatArray:
    return np.array([[th1, 30.0, d3, 0.0] for th1, d3 in th1_and_d3])


def change_times_s(changes: FloatArray) -> FloatArray:
    return np.asarray(np.abs(changes).max(axis=1) / 100.0)


def departures(polygon: Polygon, motion: Motion) -> dict[str, Departure]:
    return {departure.what: departure for departure in polygon.departures(ROBOT, motion)}


def test_another_speed_along_the_lines_is_no_departure() -> None:
    positions = points((0, 0), (10, 20), (-30, 5))
    at_stops = hermite_spline(NAMES, TIMES_S, positions, np.zeros_like(positions))
    found = departures(Polygon(TIMES_S, positions), at_stops)
    assert [*found] == [*NAMES, TOOL]
    assert max(departure.distance for departure in found.values()) < 1e-9


def test_an_overshoot_is_one() -> None:
    """The cubic through 0 and 10 with the speed 20 at the end of the first second goes on to 12.96, at 4/3 s."""
    positions = points((0, 0), (10, 0), (10, 0))
    speeds = np.zeros_like(positions)
    speeds[1, 0] = 20.0
    found = departures(Polygon(TIMES_S, positions), hermite_spline(NAMES, TIMES_S, positions, speeds))
    beyond = 20.0 * 4 / 27  # v t (1 - t)^2 at t = 1/3
    assert found["th1"].distance == pytest.approx(beyond, rel=1e-5)
    assert found["th1"].t_s == pytest.approx(4 / 3, abs=0.001)
    arm_mm = np.linalg.norm(make_kinematics(ROBOT).forward(positions[1:2])[0, :2])
    assert found[TOOL].distance == pytest.approx(2 * arm_mm * np.sin(np.deg2rad(beyond) / 2), rel=1e-5)
    assert found["th2"].distance == 0.0


def test_a_point_that_is_missed_is_one_although_the_line_is_kept() -> None:
    """A blend at a reversal turns before the point: by |dv| T / 8 with dv = 20 /s, T = 0.2 s."""
    positions = points((0, 0), (10, 0), (0, 0))
    motion = blended_lines(change_times_s, NAMES, TIMES_S, positions, (False, False))
    found = departures(Polygon(TIMES_S, positions), motion)
    assert found["th1"].distance == pytest.approx(0.5)
    assert found["th1"].t_s == 1.0


@pytest.mark.slow
def test_the_nearest_place_is_the_nearest_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a search over places 1/20 000 of the line apart, one piece of a few instants after the other."""
    monkeypatch.setattr(polygon_module, "_CHUNK", 7)
    positions = points((0, 0), (40, 30), (-20, 30))
    spline = c2_spline(NAMES, TIMES_S, positions)
    ranges = np.array([joint.upper - joint.lower for joint in ROBOT.joints])
    off = np.zeros(4)
    for t_s in np.arange(0.0, 2.001, 0.01):
        start = positions[min(int(t_s), 1)]
        places = start + np.linspace(0, 1, 20_001)[:, np.newaxis] * (positions[min(int(t_s), 1) + 1] - start)
        joints = spline.positions(np.array([t_s]))[0]
        nearest = places[(((places - joints) / ranges) ** 2).sum(axis=1).argmin()]
        off = np.maximum(off, np.abs(joints - nearest))
    found = departures(Polygon(TIMES_S, positions), spline)
    assert [found[name].distance for name in NAMES] == pytest.approx(off.tolist(), abs=0.01)
    assert found["d3"].distance > 1.0


def test_lines_of_the_tool_are_straight_in_space() -> None:
    """Half a turn of the stretched arm's shoulder: the tool's arc leaves the chord by the radius."""
    positions = np.array([[-90.0, 30.0, 0.0, 0.0], [90.0, 30.0, 0.0, 0.0]])
    tool_mm = make_kinematics(ROBOT).forward(positions)[:, :3]
    times_s = TIMES_S[:2]
    motion = hermite_spline(NAMES, times_s, positions, np.zeros_like(positions))
    assert departures(Polygon(times_s, positions), motion)[TOOL].distance < 1e-9
    radius_mm = np.linalg.norm(tool_mm[0, :2])
    found = departures(Polygon(times_s, positions, tool_mm), motion)[TOOL]
    assert found.distance == pytest.approx(radius_mm, rel=1e-5)


def test_what_is_large() -> None:
    """1 % of the joint's range, 1 mm of the tool: both sides."""
    positions = points((0, 0), (10, 0), (0, 0))
    found = departures(Polygon(TIMES_S, positions), c2_spline(NAMES, TIMES_S, positions))
    assert found["th1"].allowed == pytest.approx(0.01 * (ROBOT.joint("th1").upper - ROBOT.joint("th1").lower))
    assert found[TOOL].allowed == TOOL_MM
    for departure in found.values():
        assert not replace(departure, distance=departure.allowed).is_large
        assert replace(departure, distance=departure.allowed * 1.001).is_large


def test_velocities_are_those_from_point_to_point() -> None:
    polygon = Polygon(np.array([0.0, 0.5, 2.5]), points((0, 0), (10, 20), (-30, 21)))
    assert polygon.velocities().tolist() == [[20, 0, 40, 0], [-20, 0, 0.5, 0]]
