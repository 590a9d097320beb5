"""Three of the papers' robots are SCARAs of the core's kind: the same poses, to the last bit."""

from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.usual_scara import Lift, Vertical
from tests.host.robots.kinematics.test_usual_scara import drawn, scara


def test_the_special_cases() -> None:
    """The teaching, lab and calibration robots are usual SCARAs with their papers' DH tables."""
    for name, options in {
        "teaching-scara": scara(tool=Vertical.UP, l1_mm=95.0, l2_mm=100.0, base_mm=0.0, offset_mm=0.0),
        "calibration-scara": scara(l1_mm=250.0, l2_mm=350.0, base_mm=300.0, offset_mm=0.0, drop_mm=0.0),
        "lab-scara": scara(
            Lift.FIRST,
            positive=Vertical.UP,
            l1_mm=400.0,
            l2_mm=400.0,
            base_mm=0.0,
            offset_mm=0.0,
            drop_mm=150.0,
            heading_deg=90.0,
        ),
    }.items():
        own = load_robot(name)
        joints = drawn(own, 100, seed=1)
        poses = make_kinematics(own).forward(joints)
        assert make_kinematics(options).forward(joints).tolist() == poses.tolist(), name
