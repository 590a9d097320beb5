"""Jobs of robots with other dimensions: every job of every kind fits smaller and larger ones, or names the options."""

import dataclasses

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import job_names, job_options, make_job
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.robot import Robot
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.changed import with_geometry
from tests.messages import refusing

JOBS = [
    pytest.param(name, job, marks=pytest.mark.slow if job == "every-slot" else ())
    for name in robot_names()
    for job in job_names(load_robot(name))
]


def scaled(robot: Robot, factor: float) -> Robot:
    """Return a robot whose lengths are in proportion: dimensions, lifts and slides, with home and places."""
    geometry = {
        name: value * factor if name.endswith("_mm") and not isinstance(value, str) else value
        for name, value in robot.geometry.items()
    }
    factors = {joint.name: factor if joint.unit is Unit.MM else 1.0 for joint in robot.joints}
    joints = tuple(
        dataclasses.replace(
            joint,
            lower=joint.lower * factors[joint.name],
            upper=joint.upper * factors[joint.name],
            switches=type(joint.switches)(),
            homing=None,
        )
        for joint in robot.joints
    )
    home = tuple(position * factors[joint.name] for joint, position in zip(robot.joints, robot.home, strict=True))
    places = {
        place: {name: position * factors[name] for name, position in positions.items()}
        for place, positions in robot.places.items()
    }
    return dataclasses.replace(robot, geometry=geometry, joints=joints, home=home, places=places)


@pytest.mark.parametrize("factor", [0.4, *(pytest.param(factor, marks=pytest.mark.slow) for factor in (0.7, 1.0, 1.5))])
@pytest.mark.parametrize(("name", "job"), JOBS)
def test_every_job_fits_a_robot_of_another_size(name: str, job: str, factor: float) -> None:
    robot = scaled(load_robot(name), factor)
    plan_stretched(robot, make_job(robot, job))  # a larger robot may have to be slower


@pytest.mark.parametrize(("name", "job"), JOBS)
def test_every_job_fits_narrower_joints(name: str, job: str) -> None:
    """Rotary joints of the kinds whose jobs are given in joints lose a part of their range; lifts lose a quarter."""
    robot = load_robot(name)
    in_joints = job in ("carry", "demo")
    joints = tuple(
        dataclasses.replace(
            joint,
            lower=joint.lower if joint.unit is Unit.MM else joint.lower * (0.2 if in_joints else 0.98),
            upper=joint.lower + 0.75 * (joint.upper - joint.lower)
            if joint.name in ("d1", "d3", "L1")
            else joint.upper * (0.2 if in_joints else 0.98),
            switches=type(joint.switches)(),
            homing=None,
        )
        for joint in robot.joints
    )
    limits = {joint.name: joint for joint in joints}
    places = {
        place: {key: min(value, limits[key].upper) for key, value in positions.items()}
        for place, positions in robot.places.items()
    }
    narrower = dataclasses.replace(robot, joints=joints, places=places)
    plan(narrower, make_job(narrower, job))


def test_defaults_are_the_papers_for_the_papers_robots() -> None:
    lab = job_options(load_robot("lab-scara"), "spiral")
    assert [lab[name].split()[0] for name in ("x_mm", "y_mm", "z_mm", "mm_per_rad")] == ["-300", "400", "0", "5"]
    assert job_options(load_robot("warehouse-scara"), "pull-line")["travel_mm"].startswith("180 ")
    hybrid = job_options(load_robot("hybrid-arm"), "helix")
    expected = {"x_mm": "350", "y_mm": "150", "z_mm": "500", "radius_mm": "80", "rise_mm": "60"}
    assert {name: hybrid[name].split()[0] for name in expected} == expected


def test_defaults_of_a_smaller_arm_are_in_proportion() -> None:
    half = job_options(scaled(load_robot("lab-scara"), 0.5), "spiral")
    assert [half[name].split()[0] for name in ("x_mm", "y_mm", "z_mm", "mm_per_rad")] == ["-150", "200", "0", "2.5"]


@pytest.mark.parametrize(
    ("name", "job", "geometry"),
    [
        ("lab-scara", "spiral", {"a2_mm": 760.0, "a3_mm": 40.0}),
        ("warehouse-scara", "pull-line", {"L2_mm": 330.0, "L3_mm": 20.0}),
        ("warehouse-scara", "store", {"L2_mm": 330.0, "L3_mm": 20.0}),
        ("hybrid-arm", "helix", {"z2_max_mm": 10.0}),
    ],
)
def test_what_does_not_fit_names_the_options(name: str, job: str, geometry: dict[str, float]) -> None:
    robot = with_geometry(load_robot(name), **geometry)
    complaint_of(lambda: make_job(robot, job))


def test_the_named_options_help() -> None:
    """The arm of 600 + 200 mm does not reach the paper's place; 640 mm from its axis it does."""
    robot = with_geometry(load_robot("lab-scara"), a2_mm=600.0, a3_mm=200.0)
    with refusing(InputError):
        make_job(robot, "spiral", {"x_mm": "-100", "y_mm": "300"})
    plan_stretched(robot, make_job(robot, "spiral", {"x_mm": "-400", "y_mm": "500"}))


def test_a_lift_at_its_end_cannot_go_down_to_a_box() -> None:
    robot = load_robot("warehouse-scara")
    place = {**robot.places["hand-over"], "L1": 50.0}
    low = dataclasses.replace(robot, places={**robot.places, "hand-over": place})
    words = "places.hand-over.L1: 50 mm is the lift's lower end: it cannot go down to a box"
    assert complaint_of(lambda: make_job(low, "store")) == words
