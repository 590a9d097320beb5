"""Motors that turn with the board: what the rotors do, what the board knows of it, how homing recovers a slip."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Scheduled
from steptwin.features.faults.kinds.machine import Payload, Slip
from steptwin.features.motors.evidence import trace_of
from steptwin.features.motors.options import MotorOptions
from steptwin.features.motors.report import print_motors, warn_of_payloads
from steptwin.features.motors.rotors.rotor_watch import RotorWatch
from steptwin.features.motors.rotors.rotors import RotorRecord, Rotors
from steptwin.features.motors.turning import motors_of_run
from steptwin.features.motors.turning.after_run import RotorTrace, rotors_after_run
from steptwin.features.motors.turning.driving import Driving, PayloadTimes
from steptwin.features.motors.turning.mechanism import arm_of
from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing import homing_settings
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.live.served_board import ServedBoard
from steptwin.protocol import od
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND
from tests.features.faults.short_runs import played
from tests.host.twin.embedded.test_excitation import HOMING, Master
from tests.host.twin.live.live_session import JOINT, NMT_START, LiveSession
from tests.messages import refusing

TEACHING, LAB, WAREHOUSE = (load_robot(name) for name in ("teaching-scara", "lab-scara", "warehouse-scara"))
LIMIT_METHOD = 17
TURNING = [MotorOptions(motors=True)]


def assert_same(ours: RotorTrace, theirs: RotorTrace, rows: int) -> None:
    for name in ("counts", "positions", "load_deg", "torque_nm", "lost_full_steps", "warmer_k"):
        np.testing.assert_array_equal(getattr(ours, name)[:rows], getattr(theirs, name)[:rows], err_msg=name)


def rotors_of(ran: Outcome) -> RotorTrace:
    found = trace_of(ran.comparison.evidence)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def outcomes(fast_kernel: Kernel) -> tuple[Outcome, Outcome]:
    """The same run without motors and with them."""
    made = plan(TEACHING, make_job(TEACHING, "carry", {}))
    return execute(made, "carry", fast_kernel), execute(made, "carry", fast_kernel, extras=TURNING)


@pytest.mark.slow
def test_rotors_in_the_loop_do_what_they_do_after_the_run(outcomes: tuple[Outcome, Outcome]) -> None:
    """To the last bit: how time is divided changes nothing, and the board's edges are the same as without motors."""
    without, ran = outcomes
    assert trace_of(without.comparison.evidence) is None
    after = rotors_after_run(Driving.of(TEACHING, ran.comparison.evidence))
    assert_same(rotors_of(ran), after, len(after.counts))
    assert np.abs(after.load_deg).max() > 20.0
    assert ran.bus_log == without.bus_log
    for ours, theirs in zip(ran.comparison.evidence.axes, without.comparison.evidence.axes, strict=True):
        np.testing.assert_array_equal(ours.step_counts, theirs.step_counts)
    verdict = motors_of_run(TEACHING, ran.comparison, trace=rotors_of(ran)).verdict
    assert verdict == motors_of_run(TEACHING, ran.comparison).verdict


def test_the_payload_hangs_while_the_output_is_on(fast_kernel: Kernel) -> None:
    """A payload of 5 kg, taken and left within a ms while the arm turns: the rotors feel it as after a run."""
    assert WAREHOUSE.dynamics is not None
    heavy, free = (
        replace(WAREHOUSE, dynamics=replace(WAREHOUSE.dynamics, payload_kg=payload_kg)) for payload_kg in (5.0, 0.0)
    )
    board = BoardUnderTest(heavy, kernel=fast_kernel, extras=TURNING)
    shoulder, hand = Master(board, "th1"), Master(board, "th3")
    hand.write(od.DIGITAL_OUTPUTS_MASK, 0x10000, 4)
    shoulder.enable()
    shoulder.move_to(20.0, 0.0103)
    for level in (0x10000, 0):
        hand.write(od.DIGITAL_OUTPUTS, level, 4)
        board.wait(0.0503)
    evidence = board.evidence()
    (pin,) = [axis.pins["out1"] for axis in evidence.axes if axis.name == "th3"]
    assert len(pin.counts) == 2
    ours, after = board.settled(evidence)["motors"].trace, rotors_after_run(Driving.of(heavy, evidence))
    assert ours is not None
    assert_same(ours, after, len(after.counts))
    without = rotors_after_run(Driving.of(free, evidence))
    taken = -(-int(pin.counts[0]) // 72_000)
    assert_same(ours, without, taken)
    assert not np.array_equal(ours.load_deg[taken], without.load_deg[taken])


class TestAnotherPayload:
    """A scenario that changes the payload of the teaching robot, which always hangs, in the middle of its motion."""

    @pytest.mark.slow
    def test_hangs_until_its_end(self, fast_kernel: Kernel, outcomes: tuple[Outcome, Outcome]) -> None:
        """The rotors are those of an arm that takes it and leaves it again, and of the usual one before."""
        _, usual = outcomes
        fault = '[[fault]]\nat_s = 0.3003\ndo = "payload"\npayload_kg = 0.5\nfor_s = 0.2004\n'
        ran, report = played(fast_kernel, fault, motors=True)
        assert report.passed
        evidence = ran.comparison.evidence
        driving = Driving.of(TEACHING, evidence)
        at_s = np.array([0.3003, 0.3003 + 0.2004])
        counts = evidence.start_counts + np.rint(at_s * COUNTS_PER_SECOND).astype(np.int64)
        changed = replace(
            driving,
            payload=PayloadTimes(counts, np.array([False, True, False])),
            arms=(driving.arms[1], arm_of(TEACHING, 0.5)),
        )
        after = rotors_after_run(changed)
        assert_same(rotors_of(ran), after, len(after.counts))
        taken = -(-int(counts[0]) // COUNTS_PER_MS)
        assert_same(rotors_of(ran), rotors_of(usual), taken)
        assert not np.array_equal(rotors_of(ran).load_deg[taken], rotors_of(usual).load_deg[taken])

    @pytest.mark.slow
    def test_that_is_too_heavy_makes_motors_slip(self, fast_kernel: Kernel, capsys: pytest.CaptureFixture[str]) -> None:
        """Nothing on the board tells it: the drivers have counted what was planned."""
        ran, report = played(fast_kernel, '[[fault]]\nat_s = 0.3\ndo = "payload"\npayload_kg = 100\n', motors=True)
        assert report.passed
        assert ran.report.reasons == ran.late_reasons
        verdict = motors_of_run(TEACHING, ran.comparison, trace=rotors_of(ran)).verdict
        slips = [joint.first_slip_s for joint in verdict.joints if joint.first_slip_s is not None]
        assert slips
        assert min(slips) > 0.3
        assert (verdict.payload_kg, verdict.other_payloads_kg) == (0.1, (100.0,))
        print_motors(verdict)
        warn_of_payloads(report.to_dict(), verdict.payload_kg)
        said = capsys.readouterr()
        assert "motors: LOSE STEPS, with 0.1 kg, then 100 kg at the tool and 24 V" in said.out
        assert "the run's scenario has changed the payload to 100 kg: these motors turn 0.1 kg all along" in said.err
        warn_of_payloads(ran.to_dict() | {"faults": []}, verdict.payload_kg)
        assert not capsys.readouterr().err

    def test_is_refused_without_motors(self, fast_kernel: Kernel) -> None:
        schedule = [Scheduled(72_000 * 20, Payload(5.0))]
        with refusing(InputError):
            BoardUnderTest(TEACHING, kernel=fast_kernel, schedule=schedule)
        board = BoardUnderTest(TEACHING, kernel=fast_kernel)
        with refusing(InputError):
            board.operate(Payload(1.0))


AXIS, LIMIT = "d1", -5.0
"""An axis of the lab robot, and its lower limit switch."""


@pytest.fixture(scope="module")
def weak_board(fast_kernel: Kernel) -> BoardUnderTest:
    return BoardUnderTest(LAB, stand_at={AXIS: LIMIT + 1}, kernel=fast_kernel, extras=TURNING)


@pytest.fixture(scope="module")
def places(weak_board: BoardUnderTest) -> list[tuple[float, float]]:
    """Where an axis says it is and where its rotor is: homed, out of step for want of current, and homed again."""
    master, found = Master(weak_board, AXIS), []
    for name in LAB.joint_names:
        (master if name == AXIS else Master(weak_board, name)).enable()

    def go(position: float, torque_percent: int, full_steps_per_s2: int) -> None:
        master.write(od.TORQUE_PERCENT, torque_percent, 1)
        for address in (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION):
            master.write(address, full_steps_per_s2 * 16_384, 4)
        master.move_to(position, 1.0)
        master.write(od.TORQUE_PERCENT, 100, 1)
        found.append((master.position(), weak_board.rotor_joints()[AXIS]))

    master.home(LIMIT_METHOD, LIMIT)
    go(LIMIT + 1, 100, 2000)
    go(LIMIT + 9, 20, 40_000)
    master.home(LIMIT_METHOD, LIMIT)
    go(LIMIT + 1, 100, 2000)
    return found


def test_the_board_does_not_notice_a_slip(weak_board: BoardUnderTest, places: list[tuple[float, float]]) -> None:
    _, (told, rotor), _ = places
    master = Master(weak_board, AXIS)
    assert told == pytest.approx(LIMIT + 9, abs=0.02)
    assert abs(told - rotor) > 0.3
    assert master.read(od.LOST_STEPS) == 0
    slipped = master.read(od.SLIPPED_FULL_STEPS)
    assert slipped == weak_board.slipped()[AXIS] != 0
    assert slipped % 4 == 0
    moved = master.read(od.SHAFT_POSITION) / master.units_per_unit
    assert moved == pytest.approx(weak_board.rotor_joints()[AXIS] - (LIMIT + 1), abs=0.001)


def test_homing_finds_the_same_place_after_a_slip(places: list[tuple[float, float]]) -> None:
    before, _, again = places
    step = 1 / LAB.steps_per_unit[LAB.joint_names.index(AXIS)]
    assert again[0] == before[0]
    assert again[1] == pytest.approx(before[1], abs=step)


class BoardInPieces(BoardUnderTest):
    """Its rotors follow as those of a live board do, up to two pieces of a stretch each ms."""

    pieces = 0
    """Pieces done so far."""

    def wait(self, dt_s: float) -> None:
        watch = self._machine.simulation.rotor_watch
        assert watch is not None
        for ms in range(round(1000 * dt_s)):
            super().wait(0.001)
            for _ in range(ms % 3):
                if watch.work_counts <= self._machine.simulation.now_counts:
                    watch.work()
                    self.pieces += 1


def homed(board: BoardUnderTest) -> tuple[list[object], list[float]]:
    """Meet the switch, and slip on the way; return all frames, and where the rotors are."""
    master = Master(board, "d1")
    master.enable()
    board.operate(Slip(0, 4))
    master.home(LIMIT_METHOD, -5.0)
    return list(board.bus_log), board.rotor_positions()


@pytest.fixture(scope="module")
def usual_homing(fast_kernel: Kernel) -> tuple[list[object], list[float]]:
    return homed(BoardUnderTest(LAB, stand_at={"d1": -5.3}, kernel=fast_kernel, extras=TURNING))


def test_an_elbow_that_homes_too_hard_turns_the_shoulder_out_of_step(fast_kernel: Kernel) -> None:
    """At 360 deg/s2, which its own motor manages; at the file's acceleration the shoulder's motor holds against it."""
    for acceleration, lost in ((None, False), (360.0, True)):
        board = BoardUnderTest(LAB, stand_at={"th2": 0.0, "th3": 5.0}, kernel=fast_kernel, extras=TURNING)
        start_homing(board, LAB, "th3", acceleration)
        board.wait(0.6)
        assert board.slipped()["th3"] == 0
        assert (board.slipped()["th2"] != 0) == lost


def start_homing(board: BoardUnderTest, robot: Robot, name: str, acceleration: float | None) -> Master:
    """Let a joint home, all drives enabled, with another acceleration than the file's; return its axis' master."""
    joint = robot.joint(name)
    assert joint.homing
    if acceleration:
        joint = replace(joint, homing=replace(joint.homing, acceleration=acceleration))
    masters = {each: Master(board, each) for each in robot.joint_names}
    for master in masters.values():
        master.enable()
    settings = homing_settings(joint)
    assert settings
    for address, value in settings.objects():
        masters[name].write(address, value, 1 if address == od.HOMING_METHOD else 4)
    masters[name].write(od.MODE_OF_OPERATION, HOMING, 1)
    masters[name].write(od.CONTROLWORD, 0x1F, 2)
    return masters[name]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "joint", "elbow"), [("lab-scara", "th2", "th3"), ("calibration-scara", "th1", "th2")])
@pytest.mark.parametrize("too_steep", [False, True])
def test_a_stretched_arm_homes_as_its_file_says_and_slips_if_it_homes_faster(
    name: str, joint: str, elbow: str, too_steep: bool, fast_kernel: Kernel
) -> None:
    """At the pose with the greatest inertia, near the switch; at 720 deg/s2 it needs more torque than there is."""
    robot = load_robot(name)
    stand_at = {joint: robot.joint(joint).lower + 1.0, elbow: 0.0}
    board = BoardUnderTest(robot, stand_at=stand_at, kernel=fast_kernel, extras=TURNING)
    master = start_homing(board, robot, joint, 720.0 if too_steep else None)
    board.wait(0.8 if too_steep else 4.0)
    assert too_steep or master.read(od.STATUSWORD) & 0x1400 == 0x1400
    assert (board.slipped()[joint] != 0) == too_steep


@pytest.mark.parametrize("ticks", [1, 7])
def test_the_length_of_stretches_changes_nothing(
    ticks: int,
    usual_homing: tuple[list[object], list[float]],
    fast_kernel: Kernel,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same frames, the same rotors."""
    monkeypatch.setattr("steptwin.features.motors.rotors.rotor_watch.REST_TICKS", ticks)
    assert homed(BoardUnderTest(LAB, stand_at={"d1": -5.3}, kernel=fast_kernel, extras=TURNING)) == usual_homing


def test_nor_do_pieces_of_stretches(usual_homing: tuple[list[object], list[float]], fast_kernel: Kernel) -> None:
    board = BoardInPieces(LAB, stand_at={"d1": -5.3}, kernel=fast_kernel, extras=TURNING)
    assert homed(board) == usual_homing
    assert board.pieces > 20


def test_a_slip_on_purpose_is_one_of_the_rotor(fast_kernel: Kernel) -> None:
    board = BoardUnderTest(TEACHING, kernel=fast_kernel, extras=TURNING)
    master = Master(board, "th1")
    master.enable()
    board.wait(0.02)
    before = board.rotor_positions()[0]
    board.operate(Slip(0, -8))
    board.wait(0.02)
    microsteps = TEACHING.joints[0].transmission.microsteps
    assert board.rotor_positions()[0] - before == pytest.approx(-8 * microsteps, abs=0.01)
    assert board.slipped() == {"th1": -8, "th2": 0, "d3": 0, "th4": 0}
    assert master.read(od.SLIPPED_FULL_STEPS) == -8


STOP_DEG = 131.0
"""An end stop of the teaching robot's shoulder, whose limits end at 130 degrees."""


def driven_into_its_stop(
    kernel: Kernel, kind: type[BoardUnderTest] = BoardUnderTest
) -> tuple[RotorTrace, RotorTrace, float, float, int]:
    """Move a shoulder to its limit that stands 8 degrees farther than it believes, and has no switches.

    Return what the rotors did, the same found after the run, where the shoulder believes to be and is, and its slips.
    """
    shoulder = TEACHING.joints[0]
    assert shoulder.link is not None
    stopped = replace(shoulder, switches=JointSwitches(), homing=None, link=replace(shoulder.link, stop_upper=STOP_DEG))
    robot = replace(TEACHING, joints=(stopped, *TEACHING.joints[1:]))
    board = kind(robot, stand_at={"th1": 128.0}, kernel=kernel, extras=TURNING)
    master = Master(board, "th1")
    master.enable()
    master.home(37, 120.0)
    master.move_to(130.0, 1.0)
    evidence = board.evidence()
    ours = board.settled(evidence)["motors"].trace
    assert ours is not None
    after = rotors_after_run(Driving.of(robot, evidence))
    return ours, after, master.position(), board.rotor_joints()["th1"], board.slipped()["th1"]


@pytest.mark.slow
def test_a_motor_driven_into_its_stop_slips_and_never_goes_beyond(
    fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    stretches: list[tuple[int, float]] = []
    advance = Rotors.advance_ticks

    def recorded(rotors: Rotors, ticks: int) -> RotorRecord:
        record = advance(rotors, ticks)
        stretches.append((ticks, rotors.coordinates_rad()[0]))
        return record

    with monkeypatch.context() as patch:
        patch.setattr(Rotors, "advance_ticks", recorded)
        ours, after, believes, rests, slipped = driven_into_its_stop(fast_kernel)
    stop_rad = 2.0 * np.pi * STOP_DEG / TEACHING.joints[0].transmission.travel_per_rev
    met = next(index for index, (_, rad) in enumerate(stretches) if rad >= stop_rad)
    assert max(ticks for ticks, _ in stretches[:met]) > 10
    assert stretches[met][0] == 1  # its jerk may throw another joint into its switch
    degrees = ours.positions[:, 0]
    a_cycle = 4.0 * TEACHING.joints[0].transmission.microsteps / TEACHING.steps_per_unit[0]
    assert believes == pytest.approx(130.0, abs=0.03)
    assert STOP_DEG - 0.01 < degrees.max() < STOP_DEG + 0.01
    assert STOP_DEG - a_cycle < rests < STOP_DEG + 0.01
    assert slipped < 0
    assert believes + 8.0 + slipped / 4 * a_cycle == pytest.approx(rests, abs=0.1)
    assert_same(ours, after, len(after.counts))
    monkeypatch.setattr("steptwin.features.motors.rotors.rotor_watch.REST_TICKS", 1)
    tick_by_tick, *_ = driven_into_its_stop(fast_kernel)
    assert_same(tick_by_tick, ours, len(after.counts))
    monkeypatch.undo()
    in_pieces, *_ = driven_into_its_stop(fast_kernel, BoardInPieces)
    assert_same(in_pieces, ours, len(after.counts))


def test_without_motors_the_rotor_is_where_the_driver_has_counted(fast_kernel: Kernel) -> None:
    board = BoardUnderTest(LAB, stand_at={"d1": 20.0}, kernel=fast_kernel)
    master = Master(board, "d1")
    master.enable()
    master.home(37, 20.0)
    master.move_to(21.0, 1.0)
    assert board.rotor_joints() == board.joints()
    assert master.read(od.SHAFT_POSITION) == round(1.0 * master.units_per_unit)
    assert master.read(od.SLIPPED_FULL_STEPS) == 0


def test_a_robot_whose_masses_are_unknown_has_no_motors_in_the_loop(fast_kernel: Kernel) -> None:
    with refusing(InputError):
        BoardUnderTest(replace(LAB, dynamics=None), kernel=fast_kernel, extras=TURNING)


class TestALiveBoard:
    @pytest.mark.slow
    def test_strides_and_pieces_change_nothing(self, fast_kernel: Kernel) -> None:
        """The rotors of a board in real time are those of any other, however late its process looks."""
        found = []
        for stride_ms, pieces in ((1, 0), (7, 0), (1, 1), (1, 4)):
            session = LiveSession(fast_kernel, extras=TURNING, stride_ms=stride_ms, pieces=pieces)
            session.send(NMT_START)
            session.move(0)
            session.wait(60)
            found.append((session.board.live.simulation.rotors_full_steps(), session.board.features()["motors"]))
        assert all(each == found[0] for each in found)
        joints = found[0][1]["joints"]
        assert abs(joints[JOINT]["load_angle_deg"]) > 1.0
        assert all(joint["first_slip_s"] is None for joint in joints)

    def test_turns_rotors_while_it_has_nothing_else_to_do(
        self, fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """In a motion no stretch is left until it must be turned at once, which would make the ticks after it late."""
        at_once_ticks: list[int] = []
        turn = RotorWatch._turn  # noqa: SLF001

        def noted(watch: RotorWatch, tick: int) -> None:
            at_once_ticks.append(tick)
            turn(watch, tick)

        session = LiveSession(fast_kernel, extras=TURNING, pieces=4)
        session.send(NMT_START)
        session.move(0, 60)
        monkeypatch.setattr(RotorWatch, "_turn", noted)
        session.wait(30)
        assert session.board.live.moving
        assert not at_once_ticks

    def test_takes_another_payload(self, fast_kernel: Kernel) -> None:
        board = LiveSession(fast_kernel, extras=TURNING, axes_per_board=(4, 2)).board
        usual_kg = board.environment.payload_kg
        board.operate(Payload(5.0))
        assert usual_kg != board.environment.payload_kg == 5.0
        with refusing(InputError):
            LiveSession(fast_kernel).board.operate(Payload(5.0))

    def test_axes_of_several_boards_turn_one_arm(self, fast_kernel: Kernel) -> None:
        together, apart = (LiveSession(fast_kernel, extras=TURNING, axes_per_board=axes) for axes in ((6,), (4, 2)))
        for session in (together, apart):
            session.send(NMT_START)
            session.move(0)
        ours, theirs = (each.board.live.simulation.rotors_full_steps() for each in (together, apart))
        assert ours == pytest.approx(theirs, abs=0.05)

    def test_it_needs_numba(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
        with pytest.raises(InputError, match=r"motors=True: without numba .* install .*\[fast\]'"):
            ServedBoard(LAB, port=0, extras=TURNING)
