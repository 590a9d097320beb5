"""The client homes whole machines on the embedded board, from any position, and reports why a homing failed."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Scheduled
from steptwin.host.client import HomingSettings, Machine
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.operate.homing import homing_settings
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, ErrorCode, Mode, State
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from tests.compiled import on_sources_only
from tests.host.client.machines import L1, SETTINGS, TH1, TH3, WAREHOUSE
from tests.messages import refusing
from tests.operations import EmergencyStop


def machine_of(
    robot: Robot, start: list[float], kernel: Kernel, schedule: Iterable[Scheduled] = ()
) -> tuple[EmbeddedBoard, Machine]:
    """Return a board and its enabled machine, whose position is unknown."""
    board = EmbeddedBoard(robot, kernel, MachineOptions(stand_at=start), schedule=schedule)
    machine = Machine(board, robot.joint_names)
    machine.connect()
    machine.configure(
        tuple(
            replace(
                SETTINGS,
                microsteps=joint.transmission.microsteps,
                velocity_max_units_per_s=15_000 * UNITS_PER_FULL_STEP // joint.transmission.microsteps,
            )
            for joint in robot.joints
        )
    )
    machine.enable()
    return board, machine


def how(robot: Robot, *joints: str) -> tuple[HomingSettings | None, ...]:
    """Return the homing settings of all joints, or of some; None for the others."""
    names = joints or robot.joint_names
    return tuple(homing_settings(joint) if joint.name in names else None for joint in robot.joints)


def reported_steps(robot: Robot, machine: Machine) -> list[float]:
    """Return the axes' positions as the firmware reports them, in steps."""
    return [
        units * joint.transmission.microsteps / UNITS_PER_FULL_STEP
        for units, joint in zip(machine.positions_units(), robot.joints, strict=True)
    ]


def _each_alone(robot: Robot) -> bool:
    """Return whether each joint has one motor, which moves no other joint."""
    return robot.axes == robot.joints and not any(map(robot.coupling.couples, range(len(robot.joints))))


EACH_ALONE = [name for name in robot_names() if _each_alone(load_robot(name))]
CHEAP = ("teaching-scara",)


@pytest.mark.parametrize(
    ("name", "together"),
    [
        ("teaching-scara", False),
        pytest.param("warehouse-scara", False, marks=pytest.mark.slow),
        *(pytest.param(name, True, marks=() if name in CHEAP else pytest.mark.slow) for name in EACH_ALONE),
    ],
)
def test_every_robot_by_its_file(fast_kernel: Kernel, name: str, together: bool) -> None:
    """After homing, the firmware's position is exact to the step."""
    robot = load_robot(name)
    board, machine = machine_of(robot, list(robot.home), fast_kernel)
    heard: list[float] = []
    machine.home_axes(how(robot), heard.append, together=together)
    assert reported_steps(robot, machine) == board.driver_positions()
    assert heard == [(i + 1) / len(robot.joints) for i in range(len(robot.joints))]
    assert [axis.state() for axis in machine.axes] == [State.OPERATION_ENABLED] * len(robot.joints)


@pytest.mark.slow
@settings(max_examples=5)
@given(data=st.data())
def test_from_anywhere(fast_kernel: Kernel, data: st.DataObject) -> None:
    """Homing works from within the limits and from on the switches; a second homing gives the same position."""
    joints = WAREHOUSE.joints
    start = [data.draw(st.floats(joint.lower - 8, joint.upper + 8), label=joint.name) for joint in joints]
    start[0], start[1] = min(start[0], 30.0), min(start[1], 20.0)  # the slides are long and slow
    board, machine = machine_of(WAREHOUSE, start, fast_kernel)
    for _ in range(2):
        machine.home_axes(how(WAREHOUSE), together=True)
        assert reported_steps(WAREHOUSE, machine) == board.driver_positions()


def test_one_by_one_the_others_stand(fast_kernel: Kernel) -> None:
    board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel)
    before = board.driver_positions()
    machine.home_axes(how(WAREHOUSE, "L1"))
    moved = [now != then for now, then in zip(board.driver_positions(), before, strict=True)]
    assert moved == [False, False, True, False, False, False]


@pytest.mark.slow
def test_a_homed_axis_goes_where_it_is_sent(fast_kernel: Kernel) -> None:
    """A profile move to 100 mm ends at 100 mm of the machine."""
    board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel)
    machine.home_axes(how(WAREHOUSE, "L1"))
    axis, joint = machine.axes[L1], WAREHOUSE.joints[L1]
    axis.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
    axis.write(od.TARGET_POSITION, round(100 * joint.transmission.wire_units_per_unit))
    axis.write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
    board.wait(10.0)
    assert board.driver_positions()[L1] == 100 * 320


def without_home_switch() -> Robot:
    """Return the machine with the wrist's home switch not plugged in."""
    wrist = replace(WAREHOUSE.joints[TH3], switches=JointSwitches(-190.0, 190.0), homing=None)
    return replace(WAREHOUSE, joints=(*WAREHOUSE.joints[:TH3], wrist))


class TestFailures:
    @pytest.mark.slow
    def test_a_switch_that_is_not_there(self, fast_kernel: Kernel) -> None:
        _, machine = machine_of(without_home_switch(), list(WAREHOUSE.home), fast_kernel)
        with refusing(DeviceFaultError):
            machine.home_axes(how(WAREHOUSE, "th3"))
        assert machine.axes[TH3].error_codes == [ErrorCode.HOMING_FAILED]

    @pytest.mark.slow
    def test_one_that_fails_stops_the_others(self, fast_kernel: Kernel) -> None:
        """th3 fails early, while sx is still searching."""
        board, machine = machine_of(without_home_switch(), [500.0, *WAREHOUSE.home[1:5], 185.0], fast_kernel)
        heard: list[float] = []
        with refusing(DeviceFaultError):
            machine.home_axes(how(WAREHOUSE, "sx", "th3"), heard.append, together=True)
        assert heard == []
        at_rest = board.driver_positions()
        board.wait(1.0)
        assert board.driver_positions() == at_rest
        assert 0 < at_rest[0] < 500 * 40

    def test_one_that_fails_leaves_those_after_it_alone(self, fast_kernel: Kernel) -> None:
        board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel)
        settings = list(how(WAREHOUSE, "th1", "th2"))
        settings[TH1] = replace(settings[TH1], timeout_ms=50)  # type: ignore[type-var]
        before = board.driver_positions()
        with refusing(DeviceFaultError):
            machine.home_axes(tuple(settings))
        assert board.driver_positions()[TH1 + 1] == before[TH1 + 1]

    def test_exchanged_limit_switches(self, fast_kernel: Kernel) -> None:
        robot = replace(WAREHOUSE, joints=tuple(replace(joint, homing=None) for joint in WAREHOUSE.joints))
        board, machine = machine_of(robot, list(WAREHOUSE.home), fast_kernel)
        settings = list(how(WAREHOUSE, "th1"))
        machine.axes[TH1].disable()
        machine.axes[TH1].write(od.POLARITY, 0xC0)  # the axis runs backwards, so each end has the other's switch
        machine.axes[TH1].enable()
        with refusing(DeviceFaultError):
            machine.home_axes(tuple(settings))
        assert board.driver_positions()[TH1] >= 125 * 44

    def test_an_emergency_stop(self, fast_kernel: Kernel) -> None:
        schedule = [Scheduled(72_000_000, EmergencyStop(pressed=True))]
        board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel, schedule)
        with refusing(DeviceFaultError):
            machine.home_axes(how(WAREHOUSE, "th1"))
        assert 1.0 <= board.now_s() < 1.3  # noticed at once, then the ramp until all axes stand

    @pytest.mark.parametrize(
        "word",
        [
            0x07,
            ENABLE_OPERATION | Control.START | Control.HALT,
            ENABLE_OPERATION,
        ],
    )
    def test_another_program_interferes(self, fast_kernel: Kernel, word: int) -> None:
        _, machine = machine_of(WAREHOUSE, [-4.0, *WAREHOUSE.home[1:]], fast_kernel)

        def interfere(_: float) -> None:
            machine.axes[TH1].write(od.CONTROLWORD, word)

        with refusing(DeviceFaultError):
            machine.home_axes(how(WAREHOUSE, "sx", "th1"), interfere, together=True)

    @pytest.mark.slow
    @on_sources_only
    def test_a_homing_that_neither_ends_nor_fails(self, fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
        board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel)
        monkeypatch.setattr(machine.axes[TH1], "read", lambda *_: 0x0237)
        begun_s = board.now_s()
        with refusing(BusError):
            machine.home_axes(how(WAREHOUSE, "th1"))
        settings = how(WAREHOUSE)[TH1]
        assert settings is not None
        assert board.now_s() - begun_s > settings.timeout_ms / 1000


class TestReports:
    """A homing is followed by what the axis reports; it is asked only once that says that the homing has ended."""

    @on_sources_only
    def test_a_search_of_seconds_asks_for_few_statuswords(
        self, fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """When a report may be from before the start, at success, before and after the start bit is taken back."""
        board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel)
        board.wait(0.5)
        axis, asked = machine.axes[TH1], Counter[int]()
        read = axis.read

        def counted(address: int) -> int:
            asked[address] += 1
            return read(address)

        monkeypatch.setattr(axis, "read", counted)
        began_s = board.now_s()
        machine.home_axes(how(WAREHOUSE, "th1"))
        assert board.now_s() - began_s > 1.0
        assert asked[od.STATUSWORD] <= 4

    def test_an_axis_that_falls_silent(self, fast_kernel: Kernel) -> None:
        board, machine = machine_of(WAREHOUSE, list(WAREHOUSE.home), fast_kernel)
        board.network.unsubscribe(0x180 + machine.axes[TH1].node_id)
        with refusing(BusError):
            machine.home_axes(how(WAREHOUSE, "th1"))
        at_rest = board.driver_positions()
        board.wait(1.0)
        assert board.driver_positions() == at_rest
