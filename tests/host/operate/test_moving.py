"""Moves: all axes arrive together and within a step, limits are kept, and other programs are not disturbed."""

import numpy as np
import pytest

from steptwin.host.client import HomingSettings
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.moving import move, nearest_joints, synchronised
from steptwin.host.operate.recovering import stop
from steptwin.host.operate.session import Session
from steptwin.host.operate.setting_up import axis_settings
from steptwin.host.planning.programs.positions import ToolPosition
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import SCARA
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status
from steptwin.protocol.homing_methods import HOME_HERE
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.client.machines import SX, TH1, TH2, TH3, Neighbour, sdo_requests
from tests.host.operate.sessions import HALF_STEPS, HOME, ROBOT, CommandLine, preset
from tests.messages import refusing

GOAL = [400.0, 0.0, 120.0, 30.0, 40.0, -60.0]


@pytest.mark.slow
def test_it_arrives_within_a_step_as_the_drivers_count(board: EmbeddedBoard, session: Session) -> None:
    moved = move(session, GOAL)
    assert moved.start == pytest.approx(HOME, abs=1e-4)
    assert np.all(np.abs(np.subtract(moved.end, GOAL)) <= HALF_STEPS)
    counted = np.array(board.driver_positions()) / ROBOT.steps_per_unit
    assert np.all(np.abs(counted - GOAL) <= HALF_STEPS)
    assert session.demanded_units() == session.units(GOAL)


@pytest.mark.slow
def test_all_axes_start_and_arrive_together(board: EmbeddedBoard, session: Session) -> None:
    """All axes start in one tick; rounding to whole milliseconds and slow last steps spread the arrivals by some ms."""
    begun_s = board.now_s()
    planned_s = move(session, GOAL).planned_s
    evidence = board.evidence()
    start_s = evidence.start_counts / COUNTS_PER_SECOND
    ends_s = [axis.step_counts[-1] / COUNTS_PER_SECOND - start_s for axis in evidence.axes if len(axis.step_counts)]
    assert len(ends_s) == 5  # sz stays
    assert begun_s < start_s
    assert max(ends_s) == pytest.approx(planned_s, abs=0.02)
    assert min(ends_s) > 0.98 * planned_s


def test_one_trapezoid_for_all() -> None:
    """Speeds and accelerations are proportional to the ways, and no joint exceeds its limits."""
    start, goal = [0] * 6, [1_000_000, 0, -300_000, 2_000_000, 40_000, 7]
    moves, planned_s = synchronised(ROBOT, start, goal, 100.0)
    per_unit = ROBOT.wire_units_per_unit
    assert list(moves) == [0, 2, 3, 4, 5]
    for axis, one in moves.items():
        joint, wire = ROBOT.joints[axis], per_unit[axis]
        assert one.velocity_units_per_s / wire <= joint.speed_max + 2 * 16 / wire
        assert one.acceleration_units_per_s2 / wire <= joint.acceleration_max * 1.001 + 1000 / wire
    for axis, one in moves.items():
        way = goal[axis]
        assert (one.travel_units, one.target_units) == (way, way)
        if abs(way) > 1000:
            ramp_s = one.velocity_units_per_s / one.acceleration_units_per_s2
            assert abs(way) / one.velocity_units_per_s + ramp_s == pytest.approx(planned_s, abs=0.002)
    assert synchronised(ROBOT, start, goal, 50.0)[1] > planned_s


@pytest.mark.slow
def test_standing_there_already_moves_nothing(board: EmbeddedBoard, session: Session) -> None:
    move(session, GOAL)
    before = board.driver_positions()
    assert move(session, GOAL).planned_s == 0.0
    assert board.driver_positions() == before


def test_the_nearest_branch() -> None:
    """Both elbow branches reach the pose; the machine keeps the one it stands in."""
    for near in ([0.0, 0.0, 100.0, 0.0, 60.0, 30.0], [0.0, 0.0, 100.0, 60.0, -60.0, 30.0]):
        pose = dict(zip(SCARA.coordinates, make_kinematics(ROBOT).forward(np.array([near]))[0].tolist(), strict=True))
        assert nearest_joints(ROBOT, ToolPosition(pose), near) == pytest.approx(near, abs=1e-6)


def test_a_pose_out_of_reach_says_why() -> None:
    """Each reason once, with the branches that it keeps away."""
    with refusing(InputError):
        nearest_joints(ROBOT, ToolPosition({"x": 9000.0, "y": 0.0, "z": 0.0, "phi": 0.0}), HOME)


def test_beyond_a_limit_nothing_is_sent(board: EmbeddedBoard, session: Session) -> None:
    joint = ROBOT.joints[TH2]
    sent = len(board.bus_log)
    with refusing(InputError):
        move(session, [*HOME[:TH2], joint.upper + 1e-6, *HOME[TH3:]])
    assert len(board.bus_log) == sent
    move(session, [*HOME[:TH2], joint.upper, *HOME[TH3:]])


def test_an_axis_of_unknown_position(board: EmbeddedBoard) -> None:
    with refusing(DeviceFaultError):
        move(Session(board, ROBOT), GOAL)


@pytest.mark.slow
def test_a_joint_moves_although_another_stands_outside_its_limits(board: EmbeddedBoard, steptwin: CommandLine) -> None:
    """As after a homing that was interrupted: homed axes stand at their switches, beyond the limits."""
    outside = [ROBOT.joints[0].lower - 5, *HOME[1:]]
    preset(board, outside)
    before = board.driver_positions()
    assert steptwin.json("move warehouse-scara th2=20")["end"]["th2"] == pytest.approx(20, abs=0.1)
    after = board.driver_positions()
    assert [i for i in range(6) if before[i] != after[i]] == [TH2]
    assert steptwin.json("move warehouse-scara sx=1")["goal"]["sx"] == 1


def test_a_joint_moves_although_another_does_not_know_its_position(board: EmbeddedBoard, steptwin: CommandLine) -> None:
    """Then the tool's pose is unknown."""
    session = Session(board, ROBOT)
    with session.charge("declare", needs=()) as charge:
        machine = charge.enable()
        here = HomingSettings(HOME_HERE, 1000, 1000, 1000, session.units(HOME)[TH2], 0)
        machine.home_axes(tuple(here if i == TH2 else None for i in range(6)))
    assert steptwin.json("move warehouse-scara th2=20")["pose"] is None
    unknown = (3, "", "steptwin: th3: the position is unknown: home the machine first, `steptwin home`\n")
    assert steptwin.run("move warehouse-scara th2=30 th3=1") == unknown
    assert steptwin.run("move warehouse-scara --z 100")[0] == 3


@pytest.mark.slow
def test_it_is_stopped_by_another_program(
    board: EmbeddedBoard, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Session(Neighbour(board, monkeypatch), ROBOT)

    def halfway(fraction: float) -> None:
        if fraction > 0.5:
            stop(other)

    with refusing(DeviceFaultError):
        move(session, GOAL, progress=halfway)
    assert np.all(np.abs(np.subtract(session.positions(session.demanded_units()), GOAL))[0] > 1)
    move(session, GOAL)


@pytest.mark.slow
def test_ctrl_c_stops_all_axes(board: EmbeddedBoard, session: Session) -> None:
    def interrupt(fraction: float) -> None:
        if fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        move(session, GOAL, progress=interrupt)
    standing = board.driver_positions()
    board.wait(1.0)
    assert board.driver_positions() == standing
    preset_again = preset(board, session.positions(session.demanded_units()))
    move(preset_again, GOAL)


def test_a_fault_is_named(session: Session) -> None:
    session.machine.disable()
    session.machine.axes[TH2].write(od.SUPPLY_VOLTAGE_MIN, 5000)  # above the 24 V of the supply
    with refusing(DeviceFaultError):
        move(session, GOAL)
    with refusing(DeviceFaultError):
        move(session, GOAL)


@pytest.mark.slow
def test_another_program_moves_it(session: Session, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    other = Session(Neighbour(board, monkeypatch), ROBOT)
    seen: list[object] = []

    def halfway(fraction: float) -> None:
        if fraction > 0.5 and not seen:
            with refusing(BusError) as caught:
                move(other, HOME)
            seen.append(caught)

    move(session, GOAL, progress=halfway)
    assert seen


def test_only_what_differs_is_written(board: EmbeddedBoard, session: Session) -> None:
    """The drives are still enabled, so a write of step timing or microsteps would be refused."""
    begin = len(board.bus_log)
    move(session, GOAL)
    written = {frame.data[1:4] for frame in sdo_requests(board, begin) if frame.data[0] >> 5 == 1}
    assert not {bytes(key) for key in written} & {b"\x00\x20\x01", b"\x01\x20\x01", b"\x7f\x60\x00"}
    assert not [frame for _, frame in board.bus_log[begin:] if frame.cob_id == 0]


@pytest.mark.slow
@pytest.mark.usefixtures("session")
def test_the_command(steptwin: CommandLine) -> None:
    document = steptwin.json("move warehouse-scara sx=50 th3=-10")
    assert document["goal"] == pytest.approx(dict(zip(ROBOT.joint_names, [50, *HOME[1:5], -10], strict=True)), abs=1e-4)
    assert list(document) == ["robot", "start", "goal", "end", "planned_s", "pose"]
    pose = document["pose"]
    document = steptwin.json(f"move warehouse-scara --x {pose['x_mm'] + 20} --speed 40")
    assert document["pose"] == pytest.approx(pose | {"x_mm": pose["x_mm"] + 20}, abs=0.1)
    exit_code, out, err = steptwin.run("move warehouse-scara 0 0 100 0 60 30")
    assert (exit_code, err) == (0, "")
    assert "tool: x " in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("warehouse-scara", "where to? either joints, or a tool pose"),
        ("warehouse-scara 1 2", "joints of warehouse-scara: 2 values for the 6 joints"),
        ("warehouse-scara th9=1", "joint 'th9' is unknown: did you mean th"),
        ("warehouse-scara sx=far", "sx: 'far' is not a number"),
        ("warehouse-scara sx=1 --x 3", "where to? either joints, or a tool pose"),
        (
            "warehouse-scara sx=1 --speed 0.99",
            "--speed 0.99: is 0.99 % of the speed; for 0.99 of it write --speed 99",
        ),
        ("warehouse-scara sx=1 --speed 0", "--speed 0: is not above 0 and up to 100 percent"),
        ("warehouse-scara sx=1 --speed 101", "--speed 101: is not above 0 and up to 100 percent"),
        ("warehouse-scara sx=99999", "sx: 99999.0 mm is outside"),
        ("warehouse-scara --x 9000", "no branch reaches x 9000"),
    ],
)
@pytest.mark.usefixtures("session")
def test_bad_input(steptwin: CommandLine, arguments: str, message: str) -> None:
    exit_code, out, err = steptwin.run(f"move {arguments}")
    assert (exit_code, out) == (2, "")
    assert err.startswith(f"steptwin: {message}")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_drives_that_are_off_are_switched_on(session: Session) -> None:
    session.machine.disable()
    move(session, GOAL)


def test_a_move_leaves_the_decelerations_of_halts(session: Session) -> None:
    """Ramps are scaled to each axis' way: after a way of a step, a pause of the next trajectory would take minutes."""
    move(session, [HOME[SX] + 50.0, *HOME[1:TH1], HOME[TH1] + 0.1, *HOME[TH1 + 1 :]])
    for axis, joint in zip(session.machine.axes, ROBOT.joints, strict=True):
        wanted = axis_settings(joint, ROBOT.board).deceleration_units_per_s2
        assert axis.read(od.PROFILE_DECELERATION) == wanted


def test_a_fault_of_an_axis_that_stands_ends_a_move_of_another(session: Session) -> None:
    def halfway(fraction: float) -> None:
        if fraction > 0.5:
            session.machine.axes[TH2].emergency_stop()

    with refusing(DeviceFaultError):
        move(session, [400.0, None, None, None, None, None], progress=halfway)
    assert session.positions(session.demanded_units())[0] < 399.0


def test_other_microsteps_make_the_position_unknown_before_anything_moves(
    board: EmbeddedBoard, session: Session
) -> None:
    """The gate sets those of the robot's file again, and then asks the axes once more."""
    machine = session.machine
    machine.disable()
    machine.axes[TH2].write(od.MICROSTEPS, 8)
    machine.enable()
    machine.preset(session.units(HOME))
    machine.disable()
    assert all(axis.read(od.STATUSWORD) & Status.POSITION_KNOWN for axis in machine.axes)
    before = board.driver_positions()
    with refusing(DeviceFaultError):
        move(session, GOAL)
    assert board.driver_positions() == before
