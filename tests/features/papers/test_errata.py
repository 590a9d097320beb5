"""Errors in the papers: each printed formula misses a golden value that the code meets."""

import dataclasses

import numpy as np
import pytest

from steptwin.features.papers.hybrid_arm import WorkingMode
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention
from tests.features.papers.golden import DRAWER_RIGHT, STATIC, Golden, Numbers, rows
from tests.features.papers.mechanisms import CALIBRATION, HYBRID, LAB, TEACHING, WAREHOUSE, hybrid_arm


def cos_deg(angle_deg: float) -> float:
    return float(np.cos(np.deg2rad(angle_deg)))


def sin_deg(angle_deg: float) -> float:
    return float(np.sin(np.deg2rad(angle_deg)))


def bent(robot: str) -> list[Golden]:
    return [golden for golden in STATIC if golden.robot == robot and any(golden.joints)]


class TestLab:
    """Wang et al. 2019."""

    @pytest.mark.parametrize("golden", [STATIC[1], STATIC[3]])
    def test_eq_5_o_x(self, golden: Golden) -> None:
        """Printed: c4 c23 - s4 s23. The sign must be plus, or the column is not perpendicular to the first one."""
        _, th2, th3, th4 = golden.joints
        columns = LAB.kinematics.dh.transforms(LAB.kinematics.dh_variables(np.array([golden.joints])))[0, :3, :3]
        c4_c23, s4_s23 = cos_deg(th4) * cos_deg(th2 + th3), sin_deg(th4) * sin_deg(th2 + th3)
        assert columns[0, 1] == pytest.approx(c4_c23 + s4_s23)
        assert columns[0, 1] == pytest.approx(sin_deg(golden.pose[3]))
        printed = np.array([c4_c23 - s4_s23, *columns[1:, 1]])
        assert abs(printed @ columns[:, 0]) > 0.05

    def test_eq_5_a_z(self) -> None:
        """Printed: 1. The tool points down."""
        transforms = LAB.kinematics.dh.transforms(LAB.kinematics.dh_variables(LAB.random_joints(10, seed=1)))
        assert transforms[:, 2, 2] == pytest.approx(np.full(10, -1.0))

    def test_eq_10_has_one_sign(self) -> None:
        """Printed: th4 = th2 + th3 - atan2(o_y, +-o_x). With the minus the attitude is wrong."""
        for golden in bent("lab-scara"):
            _, th2, th3, th4 = golden.joints
            o_x, o_y = sin_deg(golden.pose[3]), -cos_deg(golden.pose[3])
            plus, minus = (th2 + th3 - np.rad2deg(np.arctan2(o_y, sign * o_x)) for sign in (1, -1))
            assert cos_deg(plus - th4) == pytest.approx(1.0)
            assert cos_deg(minus - th4) < 0.99


class TestWarehouse:
    """Jiang et al. 2019."""

    def test_cos_beta_with_x_twice_is_above_1(self) -> None:
        """Printed: (x - l3 cos phi)^2 + (x - l3 sin phi)^2, where the second term must have y."""
        square = (275 - 40 * cos_deg(90)) ** 2 + (275 - 40 * sin_deg(90)) ** 2
        cos_beta = (square + 200**2 - 150**2) / (2 * 200 * np.sqrt(square))
        assert cos_beta == pytest.approx(1.025276, abs=1e-6)

    def test_alpha_from_an_arc_cosine_loses_the_sign_of_y(self) -> None:
        """At the drawer's end the wrist is on the other side of the arm's axis: the printed form is 100 mm off."""
        poses = np.array([(275.0, row[0], 60.0, 90.0) for row in rows(DRAWER_RIGHT)])
        found = WAREHOUSE.kinematics.forward(self.printed_inverse(poses))
        errors_mm = np.hypot(*(found - poses)[:, :2].T)
        assert errors_mm[:7] == pytest.approx(np.zeros(7), abs=1e-9)
        assert np.all(np.diff(errors_mm[6:]) > 0)
        assert errors_mm[-1] == pytest.approx(100.192379, abs=1e-6)

    @staticmethod
    def printed_inverse(poses: FloatArray) -> FloatArray:
        """Return the paper's joints, with y in place of its second x; L1 and the attitude are correct."""
        x_mm, y_mm = (
            poses[:, 0] - 40 * np.cos(np.deg2rad(poses[:, 3])),
            poses[:, 1] - 40 * np.sin(np.deg2rad(poses[:, 3])),
        )
        r_mm = np.hypot(x_mm, y_mm)
        alpha, beta = np.arccos(x_mm / r_mm), np.arccos((r_mm**2 + 200**2 - 150**2) / (2 * 200 * r_mm))
        th1, th2 = np.rad2deg(alpha - beta), np.rad2deg(np.arccos((r_mm**2 - 200**2 - 150**2) / (2 * 200 * 150)))
        zero = np.zeros_like(th1)
        return np.column_stack([zero, zero, poses[:, 2] + 40, th1, th2, poses[:, 3] - th1 - th2])


class TestTeaching:
    """Yao et al. 2017."""

    @pytest.mark.parametrize("golden", [STATIC[10], STATIC[12]])
    def test_eq_16_minus(self, golden: Golden) -> None:
        """Printed: sin th2 cos th4 - cos th2 sin th4, for the sine of phi - th1. The sign must be plus."""
        th1, th2, _, th4 = golden.joints
        first, second = sin_deg(th2) * cos_deg(th4), cos_deg(th2) * sin_deg(th4)
        assert first + second == pytest.approx(sin_deg(golden.pose[3] - th1))
        assert abs(first - second - sin_deg(golden.pose[3] - th1)) > 0.1

    @pytest.mark.parametrize("golden", bent("teaching-scara"))
    def test_eq_14_forgets_the_tool(self, golden: Golden) -> None:
        """Printed: d3 = -p_z. The tool is 40 mm below the arm."""
        assert -golden.pose[2] - golden.joints[2] == pytest.approx(40.0)
        branch = TEACHING.kinematics.solve(np.array([golden.pose]), golden.branch)
        assert branch.joints[0, 2] == pytest.approx(golden.joints[2])


class TestCalibration:
    """ICMEMTC 2016."""

    def test_its_table_read_as_modified_is_no_scara(self) -> None:
        """The text measures a and alpha as Craig does, but then the tip is 350 mm from (250, 0) for every th2."""
        joints = CALIBRATION.random_joints(1000, seed=1)
        modified = dataclasses.replace(CALIBRATION.kinematics.dh, convention=Convention.MODIFIED)
        tip_mm = modified.transforms(CALIBRATION.kinematics.dh_variables(joints))[:, :2, 3]
        assert np.hypot(tip_mm[:, 0] - 250.0, tip_mm[:, 1]) == pytest.approx(np.full(1000, 350.0))
        poses = CALIBRATION.kinematics.forward(joints)
        assert np.ptp(np.hypot(poses[:, 0] - 250.0, poses[:, 1])) > 100.0


class TestHybrid:
    """Zhou; its lost figures leave some formulas open."""

    @pytest.mark.parametrize("side", [-1, 1])
    @pytest.mark.parametrize("mode", WorkingMode)
    def test_beyond_l_minus_h_there_are_no_sliders(self, side: int, mode: WorkingMode) -> None:
        for z2_mm, reached in ((200.0 - 1e-9, True), (200.0 + 1e-9, False)):
            sliders_mm = hybrid_arm().sliders.inverse(np.array([side * z2_mm]), np.array([0.0]), mode)
            assert np.isfinite(sliders_mm).all() == reached
        pose = np.array([[400.0 + side * 200.1, 0.0, 600.0, 0.0]])
        branch = HYBRID.kinematics.solve(pose, mode.value)
        assert np.isnan(branch.joints[0, 1:3]).any()
        assert str(branch.reason(0)).startswith("waist to tool")

    @pytest.mark.parametrize("joints", [(30, 50, -50, 10), (-90, -200, -100, 45), (0, 80, 20, 0)])
    def test_z2_is_not_the_sliders_mean(self, joints: Numbers) -> None:
        """Their mean height appears in z3; z2 = (Z5 - Z6)(2 z3 - Z5 - Z6) / (4 h)."""
        _, left_mm, right_mm, _ = joints
        variables = HYBRID.kinematics.dh_variables(np.array([joints], dtype=np.float64))
        z2_mm, z3_mm = float(variables["z2"][0]), float(variables["z3"][0])
        assert z2_mm == pytest.approx((left_mm - right_mm) * (2 * z3_mm - left_mm - right_mm) / (4 * 150))
        assert abs(z2_mm - (left_mm + right_mm) / 2) > 10.0
