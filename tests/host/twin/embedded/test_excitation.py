"""The emulated mechanics follow the steps that the drivers make, whatever the board and the robot's file say."""

from dataclasses import replace
from pathlib import Path

import canopen
import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.errors import InputError
from steptwin.host.operate.doctor import Check, examine
from steptwin.host.operate.session import Session
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.record.folder import verify_folder
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.live.served_board import ServedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.od import UNITS_PER_FULL_STEP

LAB, WAREHOUSE = load_robot("lab-scara"), load_robot("warehouse-scara")
AXES = [(LAB, "d1"), (LAB, "th2"), (WAREHOUSE, "sx"), (WAREHOUSE, "th1")]
"""Of each robot an axis with 8 microsteps and one with 16."""
MODULE = "3a-module"
START = 10.0
PROFILE_POSITION, HOMING = 1, 6


class Master:
    """A master that knows CiA 402 and the units, but nothing of microsteps: the plain canopen library."""

    def __init__(self, board: BoardUnderTest, joint: str) -> None:
        self._board = board
        self._joint = board.robot.joint(joint)
        node_id = FIRST_NODE_ID + board.robot.joint_names.index(joint)
        self.node = canopen.RemoteNode(node_id, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        board.network.add_node(self.node)
        self.node.nmt.state = "OPERATIONAL"
        self.units_per_unit = self._joint.transmission.wire_units_per_unit

    def write(self, address: int, value: int, size: int) -> None:
        self.node.sdo.download(address >> 8, address & 0xFF, value.to_bytes(size, "little", signed=value < 0))

    def read(self, address: int) -> int:
        return int.from_bytes(self.node.sdo.upload(address >> 8, address & 0xFF), "little", signed=True)

    def enable(self) -> None:
        for controlword in (0x06, 0x07, 0x0F):
            self.write(od.CONTROLWORD, controlword, 2)

    def home(self, method: int, offset: float, timeout_s: float = 30.0) -> None:
        """Home, with the position that the home switch has."""
        self.write(od.HOMING_METHOD, method, 1)
        self.write(od.HOME_OFFSET, round(offset * self.units_per_unit), 4)
        self.write(od.MODE_OF_OPERATION, HOMING, 1)
        self.write(od.CONTROLWORD, 0x1F, 2)
        while timeout_s > 0 and not self.read(od.STATUSWORD) & 0x1000:
            self._board.wait(0.1)
            timeout_s -= 0.1
        assert self.read(od.STATUSWORD) & 0x1400 == 0x1400
        self.write(od.CONTROLWORD, 0x0F, 2)

    def move_to(self, position: float, wait_s: float = 10.0) -> None:
        self.write(od.MODE_OF_OPERATION, PROFILE_POSITION, 1)
        self.write(od.TARGET_POSITION, round(position * self.units_per_unit), 4)
        self.write(od.CONTROLWORD, 0x1F, 2)
        self.write(od.CONTROLWORD, 0x0F, 2)
        self._board.wait(wait_s)

    def position(self) -> float:
        """The position that the axis tells, in the joint's unit."""
        return self.read(od.POSITION_ACTUAL) / self.units_per_unit


def step_of(robot: Robot, joint: str, microsteps: int) -> float:
    """A step of a mode, in the joint's unit."""
    return UNITS_PER_FULL_STEP / microsteps / robot.joint(joint).transmission.wire_units_per_unit


@pytest.fixture(params=AXES, ids=lambda axis: f"{axis[0].name} {axis[1]}")
def axis(request: pytest.FixtureRequest) -> tuple[Robot, str]:
    found: tuple[Robot, str] = request.param
    return found


class TestAMasterThatConfiguresNothing:
    def test_moves_as_far_as_it_says(self, fast_kernel: Kernel, axis: tuple[Robot, str]) -> None:
        """The board's flash holds the robot's settings, so a move of 10 mm is one of 10 mm."""
        robot, joint = axis
        board = BoardUnderTest(robot, stand_at={joint: START}, kernel=fast_kernel)
        master = Master(board, joint)
        assert master.read(od.MICROSTEPS) == robot.joint(joint).transmission.microsteps
        master.enable()
        master.home(37, START)
        master.move_to(START + 10)
        assert master.position() == pytest.approx(START + 10, abs=0.04)
        assert board.joints()[joint] == pytest.approx(master.position(), abs=1e-9)
        assert board.mismatches() == []

    def test_finds_the_limit_switch_at_its_place(self, fast_kernel: Kernel, axis: tuple[Robot, str]) -> None:
        robot, joint = axis
        limit = robot.joint(joint).switches.negative_limit
        assert limit is not None
        board = BoardUnderTest(robot, stand_at={joint: limit + 3}, kernel=fast_kernel)
        master = Master(board, joint)
        master.enable()
        master.home(17, limit)
        assert not master.read(od.DIGITAL_INPUTS) & DigitalInput.NEGATIVE_LIMIT
        assert board.joints()[joint] > limit
        step = step_of(robot, joint, robot.joint(joint).transmission.microsteps)
        assert board.joints()[joint] == pytest.approx(master.position() + step, abs=1e-9)  # it opens a step farther

    def test_keeps_the_settings_over_a_reset(self, fast_kernel: Kernel) -> None:
        board = BoardUnderTest(LAB, kernel=fast_kernel)
        master = Master(board, "d1")
        master.write(od.MICROSTEPS, 2, 1)
        assert master.read(od.DRIVER_MICROSTEPS) == 2
        master.node.nmt.send_command(0x81)
        board.wait(0.1)
        assert (master.read(od.MICROSTEPS), master.read(od.DRIVER_MICROSTEPS)) == (8, 8)


class TestAnotherModeByThePins:
    @pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
    def test_moves_as_far_as_the_master_says(
        self, fast_kernel: Kernel, axis: tuple[Robot, str], microsteps: int
    ) -> None:
        """Positions on the wire do not depend on the mode, and neither do those of the machine."""
        robot, joint = axis
        board = BoardUnderTest(robot, stand_at={joint: START}, kernel=fast_kernel)
        master = Master(board, joint)
        master.write(od.MICROSTEPS, microsteps, 1)
        master.enable()
        master.home(37, START)
        master.move_to(START + 10)
        step = step_of(robot, joint, microsteps)
        assert board.joints()[joint] == pytest.approx(START + 10, abs=1.1 * step)
        assert board.joints()[joint] == pytest.approx(master.position(), abs=step)
        filed = robot.joint(joint).transmission.microsteps
        said = [str(mismatch) for mismatch in board.mismatches()]
        expected = f"{joint}: driver and board make {microsteps} microsteps, the robot's file says {filed}"
        assert said == ([] if microsteps == filed else [expected])

    @pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
    def test_trips_the_limit_switch_at_its_place(
        self, fast_kernel: Kernel, axis: tuple[Robot, str], microsteps: int
    ) -> None:
        robot, joint = axis
        limit = robot.joint(joint).switches.negative_limit
        assert limit is not None
        board = BoardUnderTest(robot, stand_at={joint: limit + 1}, kernel=fast_kernel)
        master = Master(board, joint)
        master.write(od.MICROSTEPS, microsteps, 1)
        master.write(od.PROFILE_VELOCITY, round(2 * master.units_per_unit), 4)
        master.enable()
        master.home(37, limit + 1)
        master.move_to(limit - 50, wait_s=3)
        assert master.read(od.ERROR_CODE) & 0xFFFF == ErrorCode.LIMIT_SWITCH
        assert board.joints()[joint] <= limit + 0.5 * step_of(robot, joint, 16)
        braking = 2 * 2 / robot.joint(joint).acceleration_max + 0.1
        assert board.joints()[joint] == pytest.approx(limit, abs=braking + step_of(robot, joint, microsteps))


class TestSwitchesOfAModule:
    @pytest.mark.parametrize(("dip", "factor"), [(1, 16), (8, 2), (2, 8)])
    def test_decide_how_far_the_machine_goes(self, fast_kernel: Kernel, dip: int, factor: int) -> None:
        board = BoardUnderTest(
            LAB, stand_at={"th2": 0.0}, kernel=fast_kernel, driver_profile=MODULE, dip_microsteps={"th2": dip}
        )
        master = Master(board, "th2")
        master.write(od.DIRSETUP_NS, 30_000, 4)
        master.write(od.DIRHOLD_NS, 30_000, 4)
        master.enable()
        master.home(37, 0)
        master.move_to(2)
        assert master.position() == pytest.approx(2, abs=0.04)
        assert board.joints()["th2"] == pytest.approx(factor * master.position(), abs=1e-9)
        assert [str(mismatch) for mismatch in board.mismatches()] == [
            f"th2: the driver makes {dip} microsteps, the board counts with 16, the robot's file says 16:"
            f" it moves {factor} times as far as the board says"
        ]

    def test_what_the_master_writes_does_not_reach_the_module(self, fast_kernel: Kernel) -> None:
        board = BoardUnderTest(LAB, kernel=fast_kernel, driver_profile=MODULE)
        master = Master(board, "d1")
        master.write(od.MICROSTEPS, 16, 1)
        assert (master.read(od.MICROSTEPS), master.read(od.DRIVER_MICROSTEPS)) == (16, 8)
        assert [(m.driver, m.board, m.filed, m.right) for m in board.mismatches()] == [(8, 16, 8, False)]

    @pytest.mark.parametrize(
        ("profile", "dip", "says"),
        [
            (MODULE, {"th9": 8}, "dip_microsteps=th9: joint 'th9' is unknown"),
            (
                MODULE,
                {"th2": 4},
                "dip_microsteps=th2: 4 is not one of 3a-module's 1, 2, 8, 16: the nearest are",
            ),
            (None, {"th2": 8}, "dip_microsteps=th2: chip-330pf has no switches for its microsteps; 3a-module has"),
        ],
    )
    def test_bad_ones(self, fast_kernel: Kernel, profile: str | None, dip: dict[str, int], says: str) -> None:
        with pytest.raises(InputError) as caught:
            BoardUnderTest(LAB, kernel=fast_kernel, driver_profile=profile, dip_microsteps=dip)
        assert str(caught.value).startswith(says)


class TestReport:
    @pytest.fixture
    def robot(self) -> Robot:
        """The lab's robot with modules that are quick enough for its step timing."""
        board = replace(LAB.board, driver_profile=MODULE, osc_pf=None, dirsetup_ns=24_000)
        return replace(LAB, board=board)

    @pytest.mark.slow
    def test_names_the_mode_and_gives_the_true_positions(
        self, robot: Robot, fast_kernel: Kernel, tmp_path: Path
    ) -> None:
        motion = plan(robot, make_job(robot, "spiral", {}))
        right = execute(motion, "spiral", fast_kernel)
        assert right.passed
        wrong = execute(motion, "spiral", fast_kernel, dip_microsteps={"th3": 8})
        assert not wrong.passed
        reason = "th3: the driver made 8 microsteps per full step, planned 16: its steps are 2 times as long"
        assert wrong.report.reasons[0] == reason
        assert all(line.startswith("th3: ") for line in wrong.report.reasons)
        assert wrong.report.axes[2].pulses == right.report.axes[2].pulses
        before, after = (np.array([run.report.joints.start, run.report.joints.end]) for run in (right, wrong))
        way, twice = before[1] - before[0], after[1] - after[0]
        assert twice[2] == pytest.approx(2 * way[2], abs=1e-6)
        assert np.array_equal(np.delete(twice, 2), np.delete(way, 2))
        assert wrong.report.tool.position_error_mm_max > 10
        wrong.save(tmp_path)
        (tmp_path / "robot.toml").write_text(_toml_with_modules(), encoding="utf-8")
        assert verify_folder(tmp_path).report.reasons == wrong.report.reasons

    def test_of_a_served_board(self, fast_kernel: Kernel) -> None:
        with ServedBoard(
            LAB, port=0, kernel=fast_kernel, driver_profile=MODULE, dip_microsteps={"th4": 2}, axes_per_board=[3, 1]
        ) as served:
            pass
        assert served.report()["mismatches"] == [
            "th4: the driver makes 2 microsteps, the board counts with 16, the robot's file says 16:"
            " it moves 8 times as far as the board says"
        ]


def _toml_with_modules() -> str:
    return LAB.toml.replace("osc_pf = 330 ", f'driver_profile = "{MODULE}"').replace(
        "dirsetup_ns = 15_000", "dirsetup_ns = 24_000"
    )


class TestDoctor:
    @staticmethod
    def settings(session: Session, joint: str) -> Check:
        return {check.name: check for check in examine(session)}[f"{joint} settings"]

    def test_finds_driver_board_and_file_alike(self, fast_kernel: Kernel) -> None:
        check = self.settings(Session(BoardUnderTest(LAB, kernel=fast_kernel), LAB), "d1")
        assert check.passed
        assert check.found.startswith("8 microsteps, highest speed ")

    def test_names_switches_that_are_set_otherwise(self, fast_kernel: Kernel) -> None:
        board = BoardUnderTest(LAB, kernel=fast_kernel, driver_profile=MODULE, dip_microsteps={"th2": 8})
        session = Session(board, LAB)
        assert self.settings(session, "th2") == Check(
            "th2 settings",
            False,
            "the driver makes 8 microsteps, the board counts with 16, the robot's file says 16: it moves 2 times as"
            " far as the board says; set the driver's switches to 16",
        )
        assert self.settings(session, "th3").passed

    def test_names_a_board_that_is_set_otherwise(self, fast_kernel: Kernel) -> None:
        session = Session(BoardUnderTest(LAB, kernel=fast_kernel), LAB)
        axis = session.machine.axes[1]
        axis.write(od.MICROSTEPS, 2)
        found = "driver and board make 2 microsteps, the robot's file says 16"
        assert self.settings(session, "th2") == Check("th2 settings", True, f"{found}: the next motion sets 16")
        axis.enable()
        assert self.settings(session, "th2") == Check(
            "th2 settings", False, f"{found}, and the power is on: `steptwin estop`"
        )

    def test_knows_that_switches_stay_as_they_are(self, fast_kernel: Kernel) -> None:
        """Driver and board agree now, but the next motion would set the board alone."""
        robot = replace(LAB, board=replace(LAB.board, driver_profile=MODULE, osc_pf=None))
        session = Session(BoardUnderTest(robot, kernel=fast_kernel, dip_microsteps={"th2": 8}), robot)
        session.machine.axes[1].write(od.MICROSTEPS, 8)
        assert self.settings(session, "th2") == Check(
            "th2 settings",
            False,
            "driver and board make 8 microsteps, the robot's file says 16; set the driver's switches to 16",
        )
