"""The tasks of tools: what they can be told, and the shortest turn between two poses."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from steptwin.host.common.errors import InputError
from steptwin.host.robots.poses import (
    DIRECTION_TASK,
    NO_TOOL,
    POSE,
    POSITION,
    SCARA,
    TASKS,
    Orientation,
    Pose,
    Task,
    Turning,
)
from tests.host.complaints import complaint_of
from tests.messages import refusing

HERE: dict[Task, Pose] = {
    SCARA: (1.0, 2.0, 3.0, 4.0),
    POSITION: (1.0, 2.0, 3.0),
    DIRECTION_TASK: (1.0, 2.0, 3.0, 0.0, 0.0, 1.0),
    POSE: (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0),
}
DOWN = Orientation("direction", (0.0, 0.0, -1.0))
TURNED = Orientation("rpy_deg", (180.0, 0.0, 90.0))


def test_every_width_is_of_one_task() -> None:
    assert sorted(task.width for task in TASKS.values()) == [0, 3, 4, 6, 7]


@pytest.mark.parametrize("task", HERE, ids=lambda task: task.name)
def test_coordinates_there_and_back(task: Task) -> None:
    figures = task.figures(np.array([HERE[task]]))
    assert figures.shape == (1, len(task.coordinates)) == (1, len(task.keys))
    assert task.of_figures(figures) == pytest.approx(np.array([HERE[task]]))


@pytest.mark.parametrize("task", HERE, ids=lambda task: task.name)
def test_what_is_left_out_stays(task: Task) -> None:
    assert task.changed(HERE[task], {"z": -5.0}, None) == pytest.approx((1.0, 2.0, -5.0, *HERE[task][3:]))
    assert task.stepped(HERE[task], {"x": 2.0}) == pytest.approx((3.0, 2.0, 3.0, *HERE[task][3:]))


@pytest.mark.parametrize(
    ("task", "coordinates", "orientation"),
    [
        (SCARA, {}, TURNED),
        (POSITION, {"phi": 1.0}, None),
        (POSITION, {}, DOWN),
        (DIRECTION_TASK, {}, TURNED),
        (POSE, {}, DOWN),
        (POSE, {"phi": 1.0}, None),
        (NO_TOOL, {"x": 1.0}, None),
    ],
)
def test_what_a_tool_cannot_be_told(task: Task, coordinates: dict[str, float], orientation: Orientation | None) -> None:
    complaint_of(lambda: task.check(coordinates, orientation))


def test_documents_and_words() -> None:
    pose = POSE.changed(HERE[POSE], {}, TURNED)
    document = POSE.document(pose)
    assert document["rpy_deg"] == pytest.approx([180.0, 0.0, 90.0])
    assert list(document) == ["x_mm", "y_mm", "z_mm", "rpy_deg", "quaternion_xyzw"]
    assert POSE.words(pose) == "x 1, y 2, z 3 mm, rpy 180 0 90 deg"
    assert DIRECTION_TASK.document(HERE[DIRECTION_TASK])["direction"] == [0.0, 0.0, 1.0]
    assert DIRECTION_TASK.words(HERE[DIRECTION_TASK]) == "x 1, y 2, z 3 mm, direction 0 0 1"
    assert SCARA.words((1.0, 2.0, 3.0, float("nan"))) == "x 1, y 2, z 3 mm"
    assert list(SCARA.document(HERE[SCARA])) == ["x_mm", "y_mm", "z_mm", "attitude_deg"]


ANGLES = st.tuples(*[st.floats(-179.0, 179.0)] * 3)


@pytest.mark.slow
@given(ANGLES, ANGLES)
def test_the_shortest_turn_is_the_great_arc(start: tuple[float, ...], goal: tuple[float, ...]) -> None:
    poses = [POSE.changed(HERE[POSE], {}, Orientation("rotvec_deg", values)) for values in (start, goal)]
    try:
        turning = Turning.shortest(POSE, *poses)
    except InputError:
        return
    part = np.linspace(0.0, 1.0, 7)
    theirs = Slerp([0.0, 1.0], Rotation.from_quat([pose[3:] for pose in poses]))(part)
    assert turning.angle_deg <= 180.0
    assert np.abs((theirs.inv() * Rotation.from_quat(turning.at(part))).magnitude()).max() < 1e-9


@pytest.mark.parametrize("angle", [179.9, -179.9])
def test_just_below_half_a_turn_it_is_certain(angle: float) -> None:
    goal = POSE.changed(HERE[POSE], {}, Orientation("rpy_deg", (0.0, 0.0, angle)))
    assert Turning.shortest(POSE, HERE[POSE], goal).turn_deg == pytest.approx([0.0, 0.0, angle])


@pytest.mark.parametrize(
    ("task", "orientation"), [(POSE, Orientation("rpy_deg", (0.0, 180.0, 0.0))), (DIRECTION_TASK, DOWN)]
)
def test_half_a_turn_is_refused(task: Task, orientation: Orientation) -> None:
    goal = task.changed(HERE[task], {}, orientation)
    with refusing(InputError):
        Turning.shortest(task, HERE[task], goal)


def test_errors_are_one_angle() -> None:
    """Of whole poses that of the rotation between them, of directions that between them, of a SCARA with its sign."""
    turned = POSE.changed(HERE[POSE], {}, Orientation("rotvec_deg", (0.3, 0.0, 0.4)))
    assert POSE.off_deg(np.array(turned), np.array(HERE[POSE])) == pytest.approx(0.5)
    tilted = DIRECTION_TASK.stepped(HERE[DIRECTION_TASK], {"rx": 0.5, "rz": 20.0})
    assert DIRECTION_TASK.off_deg(np.array(tilted), np.array(HERE[DIRECTION_TASK])) == pytest.approx(0.5, abs=0.01)
    assert SCARA.off_deg(np.array([0.0, 0.0, 0.0, -179.5]), np.array([0.0, 0.0, 0.0, 179.5])) == pytest.approx(1.0)
    assert POSITION.off_deg(np.zeros((2, 5, 3)), np.zeros((5, 3))).shape == (2, 5)


def test_a_document_has_the_scalar_that_is_not_negative() -> None:
    x, y, z, *turn = POSE.changed(HERE[POSE], {}, Orientation("rotvec_deg", (10.0, 20.0, 30.0)))
    first, second = (POSE.document((x, y, z, *(sign * part for part in turn))) for sign in (1.0, -1.0))
    assert first == second
    assert first["quaternion_xyzw"] == pytest.approx(Rotation.from_rotvec([10.0, 20.0, 30.0], degrees=True).as_quat())


def test_coordinates_of_a_direction_have_any_length() -> None:
    assert DIRECTION_TASK.of_figures(np.array([1.0, 2.0, 3.0, 0.0, 3.0, 4.0])).tolist() == [1, 2, 3, 0, 0.6, 0.8]


@pytest.mark.slow
@given(ANGLES, ANGLES)
def test_the_shortest_turn_of_a_direction_leads_there(start: tuple[float, ...], goal: tuple[float, ...]) -> None:
    """In the plane of both, by the angle between them."""
    first, last = (Orientation("rotvec_deg", values).direction for values in (start, goal))
    poses = [(0.0, 0.0, 0.0, *each.tolist()) for each in (first, last)]
    try:
        turning = Turning.shortest(DIRECTION_TASK, *poses)
    except InputError:
        return
    assert turning.at(np.array([0.0, 1.0])) == pytest.approx(np.array([first, last]), abs=1e-6)
    assert np.cos(np.deg2rad(turning.angle_deg)) == pytest.approx(first @ last, abs=1e-9)
    assert turning.turn_deg @ first == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("task", [POSE, DIRECTION_TASK], ids=lambda task: task.name)
def test_the_turning_is_the_turn_per_time(task: Task) -> None:
    """Of a steady turn in one second it is the whole turn at every instant, by differences of orientations."""
    tilted = (
        Orientation("direction", (1.0, 0.4, 0.3)) if task is DIRECTION_TASK else Orientation("rpy_deg", (50, 20, 30))
    )
    goal = task.changed(HERE[task], {}, tilted)
    turning = Turning.shortest(task, HERE[task], goal)
    t_s, dt_s = np.linspace(0.1, 0.9, 5), 1e-6
    derivative = (turning.at(t_s + dt_s) - turning.at(t_s - dt_s)) / (2.0 * dt_s)
    rates = task.turning_deg(turning.at(t_s), derivative)
    assert rates == pytest.approx(np.tile(turning.turn_deg, (5, 1)), abs=1e-6)


def test_quaternions_go_on_without_a_jump() -> None:
    """On a full turn the quaternion's sign changes once; continued, no component jumps."""
    angles = np.linspace(0.0, 360.0, 100)
    poses = np.array([POSE.changed(HERE[POSE], {}, Orientation("rotvec_deg", (0.0, 0.0, a))) for a in angles])
    poses[30:60, 3:] *= -1.0
    assert np.abs(np.diff(POSE.continued(poses), axis=0)).max() < 0.04


@pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))
def test_a_task_is_itself_behind_a_pickle(task: Task) -> None:
    assert pickle.loads(pickle.dumps(task)) is task
