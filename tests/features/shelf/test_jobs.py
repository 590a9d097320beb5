"""The warehouse robot's store and fetch jobs: their moves, and when their outputs switch."""

import dataclasses

import numpy as np
import pytest

from steptwin.features.shelf.jobs import missed_places
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion, OutputChange
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.features.shelf.shelves import ROBOT, SHELF, with_shelf
from tests.messages import refusing

SCARA = make_kinematics(ROBOT)
SX, SZ, L1 = range(3)


def job(name: str, **options: str) -> Motion:
    return make_job(ROBOT, name, options)


def pose_at(motion: Motion, switching: OutputChange) -> FloatArray:
    """Return the tool's pose in the middle of a switching, after checking that it is the same at both ends."""
    t_s = np.linspace(switching.from_s, switching.until_s, 11)
    poses = SCARA.forward(motion.positions(t_s))
    assert poses == pytest.approx(np.tile(poses[0], (11, 1)), abs=1e-9)
    assert np.abs(motion.velocities(t_s)).max() < 1e-9
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
    motion = job(name, slot=slot, elbow=elbow)
    assert [(s.output, s.on) for s in motion.output_changes] == switched
    plan(ROBOT, motion)  # within every limit
    at = {(s.output, s.on): pose_at(motion, s) for s in motion.output_changes}
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


@pytest.mark.slow
def test_slides_and_arm_never_move_together_at_the_shelf() -> None:
    """The slides move before the arm, as in the paper."""
    apart = {"pick_up": "pick-up", "output": "output"}
    lifted = dataclasses.replace(ROBOT, places={**ROBOT.places, "A2": {**ROBOT.places["A2"], "L1": 60.0}})
    for name, options in (("store", {}), ("fetch", {}), ("fetch", {"slot": "A2"}), ("every-slot", apart)):
        motion = make_job(lifted, name, options)
        moving = np.abs(motion.velocities(np.arange(0.0, motion.duration_s, 0.005))) > 1e-9
        slides, arm = moving[:, [SX, SZ]].any(axis=1), moving[:, 3:].any(axis=1)
        assert slides.any()
        assert not (slides & arm).any()


def test_the_locked_hand_moves_straight_out() -> None:
    motion = job("store")
    (lock, let_go) = [s for s in motion.output_changes if s.output == "lock"]
    poses = SCARA.forward(motion.positions(np.arange(lock.until_s, let_go.from_s, 0.01)))
    assert np.ptp(poses[:, [0, 2, 3]], axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    assert np.ptp(poses[:, 1]) == pytest.approx(180.0, abs=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"places": {"A1": {"sx": 1.0}}},
        {"places": {**ROBOT.places, "hand-over": {"sx": 1.0}}},
        {"outputs": {}, "boxes": {}, "dynamics": None},
    ],
)
def test_a_robot_file_without_a_needed_place_or_output(changes: dict[str, object]) -> None:
    robot = dataclasses.replace(ROBOT, sections={}, **changes)  # type: ignore[arg-type]
    with refusing(InputError):
        make_job(robot, "store", {})


@pytest.mark.parametrize("name", ["store", "fetch"])
def test_an_arm_that_cannot_be_drawn_back(name: str) -> None:
    """Links of 30 and 400 mm reach the drawer, but cannot fold back to the position in front of the shelf."""
    robot = dataclasses.replace(ROBOT, geometry={**ROBOT.geometry, "L2_mm": 30.0, "L3_mm": 400.0})
    with refusing(InputError):
        make_job(robot, name, {})


def test_the_hand_over_is_not_a_slot() -> None:
    with refusing(InputError):
        job("store", slot="hand-over")


@pytest.mark.slow
def test_every_slot_is_filled_and_emptied_in_turn() -> None:
    motion = job("every-slot", pick_up="pick-up", output="output")
    switched = [(s.output, s.on) for s in motion.output_changes]
    stored = [("magnet", True), ("lock", True), ("magnet", False), ("lock", False)]
    fetched = [("lock", True), ("magnet", True), ("lock", False), ("magnet", False)]
    assert switched == (stored + fetched) * len(SHELF.slots)
    at = [pose_at(motion, s)[0] for s in motion.output_changes if s.output == "lock"][::4]
    assert at == pytest.approx([ROBOT.places[slot]["sx"] + 275.0 for slot in ("A1", "A2", "B1", "B2")])
    for first, place in ((0, "pick-up"), (7, "output")):
        poses = [pose_at(motion, s)[0] for s in motion.output_changes[first::8]]
        assert poses == pytest.approx([ROBOT.places[place]["sx"] + 290.0] * 4)


def test_a_job_that_waits_for_the_sensors() -> None:
    waits = job("fetch", sensors="wait").waits
    assert [(wait.input, wait.on, wait.place) for wait in waits] == [
        ("lock_engaged", True, "A1"),
        ("drawer_end", True, "A1"),
        ("box_present", True, "A1"),
        ("lock_engaged", False, "A1"),
        ("box_present", False, "hand-over"),
    ]
    shorter = job("fetch", sensors="wait", travel_mm="179.9").waits
    assert "drawer_end" not in [wait.input for wait in shorter]
    blind = with_shelf(ROBOT, dataclasses.replace(SHELF, box_present=""))
    with refusing(InputError):
        make_job(blind, "store", {"sensors": "wait"})


def test_places_at_which_the_hand_reaches_nothing() -> None:
    """The drawers' fronts and the lids are where the jobs go, within the reach of lock and magnet."""
    assert missed_places(ROBOT) == []
    assert missed_places(load_robot("lab-scara")) == []
    beside = {"A2": {"sx": 802.1, "sz": 100.0}, "output": {**ROBOT.places["output"], "L1": 153.0}}
    robot = dataclasses.replace(ROBOT, places={**ROBOT.places, **beside})
    assert missed_places(robot) == [
        "shelf.slots.A2: the jobs bring the hand to x 1077.1, y 169.9, z 160.0 mm, 2.1 mm away; it reaches 2 mm",
        "shelf.spots.output: the jobs bring the hand to x 1090.0, y -173.2, z 133.0 mm, 3.0 mm away; it reaches 2 mm",
    ]
    near = dataclasses.replace(ROBOT, places={**ROBOT.places, "A2": {"sx": 801.9, "sz": 100.0}})
    assert missed_places(near) == []
