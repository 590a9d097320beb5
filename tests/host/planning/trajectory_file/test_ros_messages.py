"""Trajectories of six axes as MoveIt and the tools of ROS write them, in JSON and YAML; and what YAML could smuggle in.

The files in messages/ are written as their names say: `rostopic echo` of ROS 1 has lists in brackets and `secs`, `ros2
topic echo` has a line for each number and `sec`, both end with `---`, and Python writes 1e-05 without a point.
"""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory_file import read_file_motion
from steptwin.host.planning.trajectory_file.ros_points import read_yaml
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of
from tests.junk import junk_documents

MESSAGES = Path(__file__).parent / "messages"
AR4 = load_robot("ar4-mk3")
START = [0.0, 0.0, 0.0, 0.0, 90.0, 0.0]
END = [10.0, 20.0, -10.0, 0.0, 80.0, 0.0]


@pytest.mark.parametrize("name", ["ros1-display.yaml", "ros1-goal.yaml", "ros2-controller.yaml", "moveit2.json"])
def test_messages_of_six_axes(name: str) -> None:
    motion = read_file_motion(str(MESSAGES / name), AR4, units="rad")
    first, *_, last = motion.points.positions.tolist()
    assert first == pytest.approx(START, abs=1e-12)
    assert last == pytest.approx(END, abs=0.001)
    assert motion.points.times_s[-1] == 3.0
    assert plan(AR4, motion.whole).motion.duration_s == 3.0


def test_every_number_of_a_point() -> None:
    """The joints in another order, a time to the nanosecond, and -1e-05 rad, which YAML 1.1 takes for a text."""
    points = read_file_motion(str(MESSAGES / "ros1-display.yaml"), AR4, units="rad").points
    assert points.times_s.tolist() == [0.0, 1.5, 3.0]
    assert points.rounded_s == pytest.approx(0.000217)
    assert points.positions[1].tolist() == pytest.approx([5.0, 10.0, -5.0, 0.0, 85.0, -0.00057295779513], abs=1e-12)
    assert points.velocities is not None
    assert points.velocities[1].tolist() == pytest.approx(np.rad2deg([0.1, 0.2, -0.1, 0.0, -0.1, 0.0]).tolist())
    assert points.unread == ("accelerations",)


ONE = "joint_names: [a]\npoints:\n- {positions: [0], time_from_start: 0}\n- {positions: [1], time_from_start: 1}\n"
BOMB = "a: &a [x]\n" + "".join(
    f"{name}: &{name} [*{last}, *{last}]\n" for last, name in zip("abcdef", "bcdefg", strict=True)
)


def complaint(text: str) -> str:
    return complaint_of(lambda: read_yaml(text))


def test_a_message_ends_with_its_line() -> None:
    assert read_yaml(f"---\n{ONE}---\n").names == ["a"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "joint_names: is missing"),
        ("- 1", "[1.0] is not a YAML mapping"),
        ("a: [", "is not YAML: line 2: did not find expected node content"),
        ("a: \x07", "is not YAML: unacceptable character #x0007: "),
        (f"{ONE}---\n{ONE}", "has 2 messages, which begin at lines 1, 5: keep the one to be run"),
        (f"{ONE}---\n" * 5, "has 5 messages, which begin at lines 1, 5, 10, ...: keep the one to be run"),
        (BOMB, "line 2: *a is an alias: write out the value that it stands for"),
        ("a: " + "[" * 17 + "]" * 17, "line 1: more than 16 lists and mappings within one another"),
        ("joint_names: []\npoints: [1]", "point 1: 1.0 is not a YAML mapping"),
        (ONE.replace("[1]", "[on]"), "point 2, positions, a: 'on' is not a number"),
        (ONE.replace("[1]", "[.inf]"), "point 2, positions, a: '.inf' is not a number"),
        (ONE.replace("[1]", "[1_0]"), "point 2, positions, a: '1_0' is not a number"),
        (ONE.replace("[1]", f"[{'9' * 400}]"), "point 2, positions, a: inf is not a finite number up to 1e+09"),
        (ONE + "- '...'\n", "point 3: the list is cut here: `ros2 topic echo --full-length` prints all of it"),
        ("trajectory: [{}, {}]", "trajectory: has 2 motions: keep the one to be run"),
        ("trajectory: []", "trajectory: has 0 motions: keep the one to be run"),
        ("goal: 5", "goal: 5.0 is not a YAML mapping"),
        ("goal: {trajectory: {joint_trajectory: {}}, other: 1}", "other: key 'other' is unknown: there are"),
        (
            "trajectory: {}\nmulti_dof_trajectory: {points: [{}]}",
            "multi_dof_trajectory: has points; a motion of joints alone can be run",
        ),
    ],
)
def test_what_is_refused(text: str, told: str) -> None:
    assert complaint(text).startswith(told)


@pytest.mark.slow
@pytest.mark.parametrize("loader", ["CBaseLoader", "BaseLoader"])
def test_lists_within_lists_end_no_parser(loader: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With libyaml and without: sixteen are read, more refused before anything is built of them."""
    if loader == "BaseLoader":
        monkeypatch.delattr(yaml, "CBaseLoader", raising=False)
    assert complaint("[" * 16 + "]" * 16).endswith("is not a YAML mapping")
    assert complaint("[" * 500) == "line 1: more than 16 lists and mappings within one another"
    assert "line 1: " in complaint("[" * 100_000)  # libyaml counts for itself


def told(text: str) -> str:
    """What is said of a text: nothing if it is read."""
    try:
        read_yaml(text)
    except InputError as error:
        return str(error)
    return ""


@given(st.text() | st.text(alphabet="ab: -[]{}&*!#|>'\"\n\t.,0123e"))
def test_any_text_is_read_or_refused_in_a_line(text: str) -> None:
    assert "\n" not in told(text)


@pytest.mark.parametrize("stride", [pytest.param(1, marks=pytest.mark.slow), 13])
def test_junk_in_a_message_is_read_or_refused_in_a_line(stride: int) -> None:
    document = yaml.safe_load((MESSAGES / "ros2-controller.yaml").read_text(encoding="utf-8").removesuffix("---\n"))
    documents = junk_documents({"trajectory": [{"joint_trajectory": document}]})
    for change, changed in islice(documents, 0, None, stride):
        assert "\n" not in told(yaml.safe_dump(changed())), change
