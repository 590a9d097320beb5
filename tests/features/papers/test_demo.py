"""The calibration robot's demo move."""

import numpy as np
import pytest

from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics

ROBOT = load_robot("calibration-scara")
SAMPLES_S = np.arange(101.0) * 0.02


def test_golden_points() -> None:
    joints = make_job(ROBOT, "demo", {}).positions(SAMPLES_S)
    poses = make_kinematics(ROBOT).forward(joints)
    assert joints[25] == pytest.approx([9.375, -7.03125, 15.625, 14.0625])
    assert poses[25, :2] == pytest.approx([596.368043996, 55.037029855], abs=1e-6)
    assert poses[50, :3] == pytest.approx([563.512052427, 170.684167277, 250.0], abs=1e-6)
    assert poses[100, :3] == pytest.approx([463.074039201, 307.093016732, 200.0], abs=1e-6)


def test_rounded_targets() -> None:
    targets = np.floor(make_job(ROBOT, "demo", {}).positions(SAMPLES_S) * ROBOT.steps_per_unit + 0.5)
    assert np.abs(np.diff(targets, axis=0)).sum(axis=0).tolist() == [2667, 2000, 16000, 1600]


def test_d3_peaks_at_12_khz() -> None:
    motion = make_job(ROBOT, "demo", {})
    assert motion.velocities(np.array([1.0]))[0, 2] * ROBOT.steps_per_unit[2] == pytest.approx(12_000)
    plan(ROBOT, motion)
