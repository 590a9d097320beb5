"""Robots as URDFs: there and back the poses are the same, and others than chains are refused."""

from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from steptwin.features.urdf.urdf_chain import frame_of
from steptwin.features.urdf.urdf_export import TIP, urdf_of
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot, read_robot
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.kinematics.serial.rows import FixedFrame
from tests.features.arms.arms import TEXTS, chain_text, kinematics_of, random_joints
from tests.features.urdf.test_urdf_chain import MIXED
from tests.features.urdf.urdfs import robot_of
from tests.messages import refusing

RNG = np.random.default_rng(3)
RANDOM = chain_text(
    {
        f"J{i}": f"xyz_mm = {RNG.uniform(-200, 200, 3).tolist()}, rpy_deg = {RNG.uniform(-180, 180, 3).tolist()},"
        f" axis = {RNG.normal(size=3).tolist()}, slides = {str(i == 2).lower()}"
        for i in range(5)
    },
    [(-180.0, 180.0)] * 5,
    "urdf",
    "base = { xyz_mm = [1, 2, 3], rpy_deg = [10, 90, 20] }\ntool = { xyz_mm = [0, 0, 5], rpy_deg = [0, -90, 0] }",
)
ENDS = "base = { xyz_mm = [1, 2, 3], rpy_deg = [4, 5, 6] }\ntool = { xyz_mm = [7, 8, 9] }\n"
STANDARD = TEXTS["PAROL6"].replace("\n[kinematics.chain]", f"{ENDS}[kinematics.chain]", 1)


@pytest.mark.parametrize("text", [*TEXTS.values(), STANDARD, RANDOM], ids=[*TEXTS, "PAROL6 with ends", "random frames"])
def test_there_and_back_the_tool_is_at_the_same_place(text: str, tmp_path: Path) -> None:
    ours = read_robot(text)
    theirs = read_robot(robot_of(tmp_path, urdf_of(ours), snap=False).text)
    assert theirs.joint_names == ours.joint_names
    for after, before in zip(theirs.joints, ours.joints, strict=True):
        assert after.unit is before.unit
        assert (after.lower, after.upper) == pytest.approx((before.lower, before.upper), abs=1e-8)
    joints = random_joints(ours, 200)
    expected, found = (tool_frames(kinematics_of(robot), joints) for robot in (ours, theirs))
    assert found[:, :3, 3] == pytest.approx(expected[:, :3, 3], abs=1e-9)
    assert found[:, :3, :3] == pytest.approx(expected[:, :3, :3], abs=1e-12)


def test_a_file_of_a_urdf_goes_there_and_back_as_it_is(tmp_path: Path) -> None:
    first = robot_of(tmp_path, MIXED, "i", held="J4")
    assert robot_of(tmp_path, urdf_of(read_robot(first.text)), held="J4").geometry == {
        **first.geometry,
        "chain": {
            name: entries
            | {"axis": pytest.approx((np.array(entries["axis"]) / np.linalg.norm(entries["axis"])).tolist())}
            for name, entries in first.geometry["chain"].items()
        },
    }


def test_the_elements_of_a_file() -> None:
    root = fromstring(urdf_of(read_robot(TEXTS["Thor"])))
    assert root.attrib == {"name": "arm"}
    assert [each.get("name") for each in root.findall("link")] == ["base_link", *(f"link{i}" for i in range(1, 7)), TIP]
    joints = root.findall("joint")
    assert [each.get("type") for each in joints] == ["revolute"] * 6 + ["fixed"]
    second = joints[1]
    assert {each.tag: each.attrib for each in second} == {
        "parent": {"link": "link1"},
        "child": {"link": "link2"},
        "origin": {"xyz": "0.0 0.0 0.202", "rpy": "0.0 0.0 0.0"},
        "axis": {"xyz": "1.0 0.0 0.0"},
        "limit": {
            "lower": "-1.5707963267948966",
            "upper": "1.5707963267948966",
            "effort": "0",
            "velocity": "1.0471975511965976",
        },
    }
    assert joints[6].find("origin").attrib["xyz"] == "0.0 0.0 0.0135"  # type: ignore[union-attr]


def test_other_kinds_are_refused_by_name() -> None:
    with refusing(InputError):
        urdf_of(load_robot("lab-scara"))


@pytest.mark.parametrize("pitch_deg", [0.0, 89.9, 89.9995, 90.0 - 1e-7, 90.0 - 1e-11, 90.0, -90.0, -89.99999])
def test_a_frame_keeps_its_turn_near_pitch_90(pitch_deg: float) -> None:
    for roll_deg, yaw_deg in RNG.uniform(-180.0, 180.0, (20, 2)):
        transform = FixedFrame((1.0, 2.0, 3.0), (roll_deg, pitch_deg, yaw_deg)).matrix
        assert frame_of(transform).matrix == pytest.approx(transform, abs=2e-14)
