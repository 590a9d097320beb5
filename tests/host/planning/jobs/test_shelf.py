"""The warehouse robot's store and fetch jobs: their moves, and when their outputs switch."""

import dataclasses

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory import Switching, Trajectory
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics

ROBOT = load_robot("warehouse-scara")
SCARA = make_kinematics(ROBOT)
SX, SZ, L1 = range(3)


def job(name: str, **options: str) -> Trajectory:
    return make_job(ROBOT, name, options)


def pose_at(trajectory: Trajectory, switching: Switching) -> FloatArray:
    """Return the tool's pose in the middle of a switching, after checking that it is the same at both ends."""
    t_s = np.linspace(switching.from_s, switching.until_s, 11)
    poses = SCARA.forward(trajectory.positions(t_s))
    assert poses == pytest.approx(np.tile(poses[0], (11, 1)), abs=1e-9)
    assert np.abs(trajectory.velocities(t_s)).max() < 1e-9
    return np.asarray(poses[5])


@pytest.mark.parametrize(
    ("name", "switched"),
    [
        ("store", [("magnet", True), ("lock", True), ("magnet", False), ("lock", False)]),
        ("fetch", [("lock", True), ("magnet", True), ("lock", False), ("magnet", False)]),
    ],
)
@pytest.mark.parametrize("elbow", ["right", "left"])
@pytest.mark.parametrize("slot", ["A1", "A2", "B1", "B2"])
def test_outputs_switch_where_they_should(name: str, switched: list[tuple[str, bool]], elbow: str, slot: str) -> None:
    trajectory = job(name, slot=slot, elbow=elbow)
    assert [(s.output, s.on) for s in trajectory.switchings] == switched
    plan(ROBOT, trajectory)  # within every limit
    at = {(s.output, s.on): pose_at(trajectory, s) for s in trajectory.switchings}
    slides = ROBOT.places[slot]
    drawer = np.array([slides["sx"] + 275.0, 169.903810568, slides["sz"] + 60.0, 90.0])
    assert at["lock", True] == pytest.approx(drawer, abs=1e-6)
    assert at["lock", False] == pytest.approx(drawer, abs=1e-6)
    box = (switched[2] if name == "store" else switched[1])[1]
    assert at["magnet", box] == pytest.approx(drawer - [0, 180, 0, 0], abs=1e-6)
    hand_over = ROBOT.places["hand-over"]
    above = SCARA.forward(np.array([[hand_over[joint] for joint in ROBOT.joint_names]]))[0]
    assert at["magnet", not box] == pytest.approx(above - [0, 0, 30, 0], abs=1e-6)


def test_storing_begins_above_the_box_and_fetching_ends_there() -> None:
    store, fetch = job("store"), job("fetch")
    begin = store.positions(np.zeros(1))[0]
    end = fetch.positions(np.array([fetch.duration_s]))[0]
    expected = [ROBOT.places["hand-over"][joint] for joint in ROBOT.joint_names]
    assert begin == pytest.approx(expected, abs=1e-9)
    assert end == pytest.approx(expected, abs=1e-9)


def test_slides_and_arm_never_move_together_at_the_shelf() -> None:
    """The slides move before the arm, as in the paper."""
    for name in ("store", "fetch"):
        trajectory = job(name)
        moving = np.abs(trajectory.velocities(np.arange(0.0, trajectory.duration_s, 0.005))) > 1e-9
        slides, arm = moving[:, [SX, SZ]].any(axis=1), moving[:, 3:].any(axis=1)
        assert slides.any()
        assert not (slides & arm).any()


def test_the_locked_hand_moves_straight_out() -> None:
    trajectory = job("store")
    (lock, let_go) = [s for s in trajectory.switchings if s.output == "lock"]
    poses = SCARA.forward(trajectory.positions(np.arange(lock.until_s, let_go.from_s, 0.01)))
    assert np.ptp(poses[:, [0, 2, 3]], axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    assert np.ptp(poses[:, 1]) == pytest.approx(180.0, abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"places": {"A1": {"sx": 1.0}}}, "places.hand-over.sx: is missing"),
        ({"places": {**ROBOT.places, "hand-over": {"sx": 1.0}}}, "places.hand-over.sz: is missing"),
        ({"outputs": {}, "boxes": {}}, "outputs: warehouse-scara has none; its file names them under"),
    ],
)
def test_a_robot_file_without_a_needed_place_or_output(changes: dict[str, object], words: str) -> None:
    robot = dataclasses.replace(ROBOT, **changes)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=words):
        make_job(robot, "store", {})


@pytest.mark.parametrize("name", ["store", "fetch"])
def test_an_arm_that_cannot_be_drawn_back(name: str) -> None:
    """Links of 30 and 400 mm reach the drawer, but cannot fold back to the position in front of the shelf."""
    robot = dataclasses.replace(ROBOT, geometry={**ROBOT.geometry, "L2_mm": 30.0, "L3_mm": 400.0})
    with pytest.raises(
        InputError,
        match=r"^in front of the shelf: shoulder to wrist 367\.3 mm is outside 370\.\.430 mm, by 2\.68 mm; ",
    ):
        make_job(robot, name, {})


def test_the_hand_over_is_not_a_slot() -> None:
    with pytest.raises(InputError, match=r"option slot: 'hand-over' is unknown: there are A1, A2, B1, B2"):
        job("store", slot="hand-over")
