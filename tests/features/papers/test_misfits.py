"""Robots that do not fit their kinematics: each error is one line and begins with the key."""

import dataclasses

import pytest

from steptwin.features.papers.hybrid_arm import SliderPair
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.features.papers.mechanisms import CALIBRATION, HYBRID, LAB, TEACHING, WAREHOUSE, Mechanism, each_mechanism
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.changed import with_geometry
from tests.messages import refusing


def complaint(robot: Robot) -> str:
    return complaint_of(lambda: make_kinematics(robot))


def test_an_unknown_kind() -> None:
    robot = dataclasses.replace(WAREHOUSE.robot, kinematics="warehouse")
    assert complaint(robot) == "kinematics.kind: 'warehouse' is unknown: did you mean warehouse-scara?"


@each_mechanism
def test_a_missing_dimension(mechanism: Mechanism) -> None:
    for name in mechanism.robot.geometry:
        geometry = {key: value for key, value in mechanism.robot.geometry.items() if key != name}
        robot = dataclasses.replace(mechanism.robot, geometry=geometry)
        assert complaint(robot) == f"kinematics.{name}: is missing"


@each_mechanism
def test_an_unknown_dimension(mechanism: Mechanism) -> None:
    robot = with_geometry(mechanism.robot, zzz_mm=1.0)
    assert complaint(robot).startswith("kinematics.zzz_mm: key 'zzz_mm' is unknown: ")


@each_mechanism
def test_other_joints(mechanism: Mechanism) -> None:
    joints, home = mechanism.robot.joints[::-1], mechanism.robot.home[::-1]
    turned = dataclasses.replace(mechanism.robot, joints=joints, home=home)
    given, right = (" ".join(joint.name for joint in some) for some in (joints, joints[::-1]))
    assert complaint(turned) == f"joints: {given} is not the order of the joints of this {turned.kinematics!r}: {right}"


@each_mechanism
def test_a_joint_of_another_unit(mechanism: Mechanism) -> None:
    for i, joint in enumerate(mechanism.robot.joints):
        other = next(unit for unit in Unit if unit is not joint.unit)
        joints = list(mechanism.robot.joints)
        joints[i] = dataclasses.replace(joint, unit=other)
        words = f"joints.{joint.name}.unit: '{other}' is not the unit of this joint: it is '{joint.unit}'"
        assert complaint(dataclasses.replace(mechanism.robot, joints=tuple(joints))) == words


@pytest.mark.parametrize(
    ("mechanism", "dimensions"),
    [
        pytest.param(LAB, {"a2_mm": 0.0}, id="lab"),
        pytest.param(WAREHOUSE, {"L3_mm": -1.0}, id="warehouse"),
        pytest.param(TEACHING, {"l1_mm": 0.0}, id="teaching"),
        pytest.param(CALIBRATION, {"L2_mm": 0.0}, id="calibration"),
        pytest.param(
            CALIBRATION,
            {"alpha3_deg": 90.0},
            id="a tool that points sideways",
        ),
        pytest.param(
            HYBRID,
            {"h_mm": 350.0},
            id="links that just do not reach across",
        ),
        pytest.param(
            HYBRID,
            {"h_mm": 0.0},
            id="both screws in one place",
        ),
        pytest.param(
            HYBRID,
            {"z2_max_mm": 200.1},
            id="beyond the links",
        ),
        pytest.param(
            HYBRID,
            {"z2_max_mm": 0.0},
            id="no way sideways",
        ),
        pytest.param(
            HYBRID,
            {"l2_mm": 50.0, "l3_mm": 100.0},
            id="through the waist",
        ),
    ],
    ids=str,
)
def test_impossible_dimensions(mechanism: Mechanism, dimensions: dict[str, float]) -> None:
    complaint(with_geometry(mechanism.robot, **dimensions))


@pytest.mark.parametrize(
    ("mechanism", "dimensions"),
    [
        (HYBRID, {"h_mm": 199.9}),
        (HYBRID, {"z2_max_mm": 200.0}),
        (HYBRID, {"l2_mm": 50.0, "l3_mm": 100.1}),
        (CALIBRATION, {"alpha3_deg": 0.0}),
    ],
)
def test_dimensions_that_just_fit(mechanism: Mechanism, dimensions: dict[str, float]) -> None:
    make_kinematics(with_geometry(mechanism.robot, **dimensions))


@pytest.mark.parametrize("dimensions", [(float("nan"), 350.0), (150.0, float("nan")), (-1.0, 350.0)])
def test_impossible_sliders(dimensions: tuple[float, float]) -> None:
    with refusing(InputError):
        SliderPair(*dimensions)
