"""The DH chain with errors: the nominal one is the closed form, and the derivatives are those of the product."""

import dataclasses

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot, parse_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.chain import MOVES, Chain, actual_chain
from steptwin.host.robots.link_errors import LinkErrors
from tests.features.papers.mechanisms import CALIBRATION, HYBRID, LAB, SCARAS, TEACHING, Mechanism, each_scara
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.changed import pose_errors
from tests.host.robots.kinematics.test_dh import printed_link

PROBE = 1e-4
"""Half the step of a central difference, in mm and degrees; its own error is of the order of 1e-9."""


def disturbed(mechanism: Mechanism, seed: int = 5) -> Chain:
    """Return the chain with errors of a badly built machine."""
    chain = Chain.of(mechanism.robot)
    sizes = [0.5, 0.3, 0.5, 0.3]
    return chain.with_errors(np.random.default_rng(seed).normal(0.0, sizes, chain.errors.shape))


def turns_deg(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the small rotations between two arrays of rotation matrices, about the world's axes."""
    skew = after @ before.swapaxes(1, 2)
    return np.rad2deg(np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1))


@each_scara
def test_without_errors_it_is_the_closed_form(mechanism: Mechanism) -> None:
    chain, joints = Chain.of(mechanism.robot), mechanism.random_joints(500, seed=8)
    assert pose_errors(chain.poses(joints), mechanism.kinematics.forward(joints)).max() < 1e-9
    assert chain.tilts_deg(joints).max() < 1e-9


@each_scara
def test_with_errors_it_is_the_product_of_the_printed_matrices(mechanism: Mechanism) -> None:
    """Each link as textbooks print it, multiplied out, with the errors added to its four parameters."""
    chain, joints = disturbed(mechanism), mechanism.random_joints(3, seed=9)
    variables = mechanism.kinematics.dh_variables(joints)
    for i, found in enumerate(chain.transforms(joints)):
        at = {name: values[i : i + 1] for name, values in variables.items()}
        links = [
            printed_link(
                chain.table.convention,
                row.alpha_deg + alpha_deg,
                row.a_mm + a_mm,
                float(row.d_mm.values(at).item()) + d_mm,
                float(row.theta_deg.values(at).item()) + theta_deg,
            )
            for row, (a_mm, alpha_deg, d_mm, theta_deg) in zip(chain.table.rows, chain.errors, strict=True)
        ]
        expected = np.linalg.multi_dot(links)
        assert found == pytest.approx(expected, abs=1e-10)
        x, y, z, attitude_deg = chain.poses(joints)[i]
        assert (x, y, z) == pytest.approx(expected[:3, 3], abs=1e-10)
        assert np.exp(1j * np.deg2rad(attitude_deg)) == pytest.approx(
            complex(*expected[:2, 0]) / np.hypot(*expected[:2, 0]), abs=1e-12
        )
        assert chain.tilts_deg(joints)[i] == pytest.approx(np.rad2deg(np.arccos(abs(expected[2, 2]))), abs=1e-6)


@each_scara
@pytest.mark.parametrize("built", ["nominal", "disturbed"])
def test_the_derivatives_are_central_differences(mechanism: Mechanism, built: str) -> None:
    chain = Chain.of(mechanism.robot) if built == "nominal" else disturbed(mechanism)
    joints = mechanism.random_joints(10, seed=10)
    found = chain.sensitivities(joints)
    assert found.shape == (10, len(MOVES), len(chain.parameters)) == (10, 6, 4 * len(chain.table.rows))
    for i in range(chain.errors.size):
        step = np.zeros(chain.errors.size)
        step[i] = PROBE
        less, more = (chain.with_errors(chain.errors.ravel() + sign * step).transforms(joints) for sign in (-1.0, 1.0))
        assert found[:, :3, i] == pytest.approx((more - less)[:, :3, 3] / (2 * PROBE), abs=1e-6)
        turned_deg = turns_deg(less[:, :3, :3], more[:, :3, :3])
        assert found[:, 3:, i] == pytest.approx(turned_deg / (2 * PROBE), abs=1e-6)


def test_derivatives_of_the_paper_s_arm_by_hand() -> None:
    """L1 = 250, L2 = 350 stretched along x with d3 = 50: what an error does can be seen."""
    chain = Chain.of(CALIBRATION.robot)
    (derivatives,) = chain.sensitivities(np.array([[0.0, 0.0, 50.0, 0.0]])).round(12)
    moves = dict(zip(chain.parameters, derivatives.T.tolist(), strict=True))
    per_deg = np.pi / 180
    assert moves["link1.a_mm"] == [1, 0, 0, 0, 0, 0]
    assert moves["link1.d_mm"] == [0, 0, 1, 0, 0, 0]
    assert moves["link1.theta_deg"] == pytest.approx([0, 600 * per_deg, 0, 0, 0, 1])
    assert moves["link2.theta_deg"] == pytest.approx([0, 350 * per_deg, 0, 0, 0, 1])
    assert moves["link1.alpha_deg"] == pytest.approx([0, 50 * per_deg, 0, 1, 0, 0])  # the tool is 50 mm below
    assert moves["link4.d_mm"] == [0, 0, -1, 0, 0, 0]
    assert moves["link4.theta_deg"] == [0, 0, 0, 0, 0, -1]


def test_the_file_s_errors_are_those_of_the_chain() -> None:
    errors = {"link1": LinkErrors(0.5, 0.1, -0.2, 0.3), "link4": LinkErrors(theta_deg=-0.25)}
    chain = actual_chain(dataclasses.replace(TEACHING.robot, dh_errors=errors))
    assert chain is not None
    assert chain.errors.tolist() == [[0.5, 0.1, -0.2, 0.3], [0] * 4, [0] * 4, [0, 0, 0, -0.25]]
    assert chain.link_errors == errors
    assert chain.parameters[:4] == ("link1.a_mm", "link1.alpha_deg", "link1.d_mm", "link1.theta_deg")
    assert actual_chain(TEACHING.robot) is None


def test_errors_plan_nothing() -> None:
    """The kinematics by which motions are planned stays nominal."""
    robot = parse_robot(f"{load_robot('lab-scara').toml}\n[dh_errors.link3]\na_mm = 1.0\n", "lab.toml")
    joints = LAB.random_joints(20, seed=4)
    nominal = LAB.kinematics.forward(joints)
    assert make_kinematics(robot).forward(joints).tolist() == nominal.tolist()
    off_mm = np.linalg.norm((Chain.of(robot).poses(joints) - nominal)[:, :3], axis=1)
    assert off_mm == pytest.approx(1.0)


@pytest.mark.parametrize("mechanism", [*SCARAS, HYBRID], ids=lambda each: each.name)
def test_only_the_hybrid_arm_is_no_chain(mechanism: Mechanism) -> None:
    if mechanism is HYBRID:
        words = "hybrid-arm: a 'hybrid-arm' is not a chain of DH links: z2 and z3 are no joints"
        assert complaint_of(lambda: Chain.of(mechanism.robot)) == words
    else:
        assert Chain.of(mechanism.robot).joint_names == mechanism.robot.joint_names


def test_a_link_that_the_chain_does_not_have() -> None:
    robot = dataclasses.replace(TEACHING.robot, dh_errors={"link5": LinkErrors(a_mm=1.0)})
    complaint_of(lambda: Chain.of(robot))


@each_scara
def test_what_the_sum_of_errors_leaves_out_is_of_second_order(mechanism: Mechanism) -> None:
    """Errors half as large leave out a quarter."""
    joints, whole = mechanism.random_joints(50, seed=11), disturbed(mechanism).errors.ravel()
    nominal = Chain.of(mechanism.robot)

    def left_out_mm(errors: FloatArray) -> float:
        exact_mm = (nominal.with_errors(errors).transforms(joints) - nominal.transforms(joints))[:, :3, 3]
        return float(np.linalg.norm(exact_mm - nominal.sensitivities(joints)[:, :3] @ errors, axis=1).mean())

    assert left_out_mm(whole) / left_out_mm(whole / 2) == pytest.approx(4.0, rel=0.05)
