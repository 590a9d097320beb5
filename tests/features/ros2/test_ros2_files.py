"""Files for ros2_canopen: its configurator takes them, and the cycle of its motor driver moves the emulated board.

The cycle is written after ros2_canopen's Motor402 and HomingMode: each 10 ms it reads statusword, mode and position of
the last SYNC and writes controlword, mode and target; ROS itself was never there.
"""

import struct
from math import pi
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml

from steptwin.controller.motion.backend import Kernel
from steptwin.features.ros2.ros2_files import ros2_files, scale_to_dev
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.messages import refusing
from tests.protocol.test_exports import concise, run_lely

ROBOT = load_robot("teaching-scara")
NODE = 0x10
PERIOD_S = 0.01
STEP_UNITS = 1024
"""The actual position is told in whole steps."""
ONE_BY_ONE = [name for name in robot_names() if not load_robot(name).coupling.matrix]


@pytest.fixture
def configured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files and what dcfgen makes of them, called in it as CMake's generate_dcf does."""
    monkeypatch.chdir(tmp_path)
    for name, text in ros2_files(ROBOT).items():
        (tmp_path / name).write_text(text.replace("@BUS_CONFIG_PATH@", str(tmp_path)), encoding="utf-8")
    run_lely("dcfgen.cli", "-r", "-d", str(tmp_path), str(tmp_path / "bus.yml"))
    return tmp_path


class Motor:
    """One axis' driver: what ros2_canopen's Motor402 does in a cycle."""

    def __init__(self, board: BoardUnderTest, folder: Path) -> None:
        """Configure the node as the master does at boot: each write of its concise DCF."""
        self.board = board
        self.control = self.mode = self.target = self.velocity = 0
        node = board.network.add_node(NODE)
        node.sdo.RESPONSE_TIMEOUT = 1.0
        for address, data in concise(folder / "th1.bin"):
            node.sdo.download(address >> 8, address & 0xFF, data)
        board.network.send_message(0x000, bytes((1, NODE)))

    def cycle(self) -> None:
        """Send both PDOs and a SYNC, and wait a period."""
        send = self.board.network.send_message
        send(0x200 + NODE, struct.pack("<Hb", self.control, self.mode))
        send(0x300 + NODE, struct.pack("<ii", self.target, self.velocity))
        send(0x080, b"")
        self.board.wait(PERIOD_S)

    def told(self, cob_id: int, form: str) -> tuple[int, ...]:
        """Return what the node said last by a PDO."""
        data = next(frame.data for _, frame in reversed(self.board.bus_log) if frame.cob_id == cob_id + NODE)
        return struct.unpack(form, data)

    @property
    def status(self) -> int:
        return self.told(0x180, "<Hb")[0]

    @property
    def position(self) -> int:
        return self.told(0x280, "<ii")[0]

    def until(self, bits: int, set_: int, cycles: int = 1000) -> int:
        """Go on until bits of the statusword are so; return the number of cycles."""
        for number in range(cycles):
            if self.status & bits == set_:
                return number
            self.cycle()
        raise AssertionError(f"0x{self.status:04X} after {cycles} cycles")

    def switch_to(self, mode: int) -> None:
        """Ask for a mode, without a set-point, until the node shows it."""
        self.mode, self.control = mode, 0x0F
        for _ in range(20):
            self.cycle()
            if self.told(0x180, "<Hb")[1] == mode:
                return
        raise AssertionError(f"mode {self.told(0x180, '<Hb')[1]}, not {mode}")

    def enable(self) -> None:
        self.cycle()
        for control, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
            self.control = control
            self.until(0x6F, state, 20)


@pytest.mark.slow
def test_the_drivers_cycle_enables_homes_and_moves_an_axis(fast_kernel: Kernel, configured: Path) -> None:
    board = BoardUnderTest(ROBOT, kernel=fast_kernel, stand_at={"th1": 10.0})
    motor = Motor(board, configured)
    motor.enable()
    motor.switch_to(6)
    motor.control = 0x1F
    motor.cycle()
    motor.until(0x1400 | 0x2000, 0x1400)  # homing attained, target reached, no error
    assert board.joints()["th1"] == pytest.approx(
        motor.position / ROBOT.axes[0].transmission.wire_units_per_unit, abs=0.05
    )

    home = motor.position  # profile position: away from the switch by a tenth of a rad
    way = round(0.1 * scale_to_dev(ROBOT.joints[0]))
    motor.target = home + way
    motor.switch_to(1)
    motor.control = 0x3F
    motor.cycle()
    motor.until(0x1000, 0x1000)  # the set-point is acknowledged
    motor.control = 0x2F
    motor.until(0x1000, 0)
    motor.until(0x0400, 0x0400)
    assert motor.position == pytest.approx(home + way, abs=STEP_UNITS)

    begin = motor.target = motor.position  # cyclic position: back by half of it in 100 cycles
    motor.switch_to(8)
    for number in range(1, 101):
        motor.target = begin - number * way // 200
        motor.cycle()
    for _ in range(5):
        motor.cycle()
    assert motor.position == pytest.approx(begin - 100 * way // 200, abs=STEP_UNITS)
    assert board.violations() == []


@pytest.mark.slow
@pytest.mark.parametrize("mode", [3, 9], ids=["pv", "csv"])
def test_the_drivers_cycle_moves_an_axis_by_velocity(fast_kernel: Kernel, configured: Path, mode: int) -> None:
    """Each cycle sends the target velocity; the first one that counts comes after the mode is on."""
    board = BoardUnderTest(ROBOT, kernel=fast_kernel)
    motor = Motor(board, configured)
    motor.enable()
    motor.switch_to(mode)
    begin = motor.position
    speed = round(0.2 * scale_to_dev(ROBOT.joints[0]))
    motor.velocity = speed
    for _ in range(100):
        motor.cycle()
    assert motor.told(0x280, "<ii")[1] == pytest.approx(speed, rel=0.02)
    motor.velocity = 0
    for _ in range(100):
        motor.cycle()
    assert motor.told(0x280, "<ii")[1] == 0
    assert motor.position - begin == pytest.approx(speed, rel=0.1), "two ramps"
    assert board.violations() == []


@pytest.mark.parametrize("name", ONE_BY_ONE)
def test_every_robot_whose_axes_move_one_by_one_has_the_files(name: str) -> None:
    robot = load_robot(name)
    files = ros2_files(robot)
    bus = yaml.safe_load(files["bus.yml"])
    assert list(bus) == ["options", "master", *robot.joint_names]
    for number, joint in enumerate(robot.joints):
        axis = bus[joint.name]
        per_unit = 180.0 / pi if joint.unit == "deg" else 1000.0
        assert axis["node_id"] == NODE + number
        assert axis["scale_pos_to_dev"] == pytest.approx(joint.transmission.wire_units_per_unit * per_unit, rel=1e-9)
        assert axis["scale_pos_to_dev"] * axis["scale_pos_from_dev"] == pytest.approx(1.0, rel=1e-9)
        types = [pdo["transmission"] for way in ("rpdo", "tpdo") for pdo in axis[way].values()]
        assert types == [1, 1, 1, 1], "controlword and target act together, with SYNC"
        methods = [each["value"] for each in axis["sdo"] if each["index"] == 0x6098]
        assert methods == [joint.homing.method if joint.homing else 0]
    control = ET.fromstring(files["ros2_control.urdf"])
    assert [each.get("name") for each in control.findall("joint")] == list(robot.joint_names)


def test_coupled_joints_are_refused() -> None:
    coupled = next(name for name in robot_names() if load_robot(name).coupling.matrix)
    with refusing(InputError):
        ros2_files(load_robot(coupled))


def test_the_command_writes_them_and_replaces_nothing_unasked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "config"
    assert run(["ros2", "ar4-mk3", "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {
        "README.md",
        "ar4-mk3.urdf",
        "axis.eds",
        "bus.yml",
        "ros2_control.urdf",
    }
    assert run(["ros2", "ar4-mk3", "--out", str(out)]) == 2
    assert "--replace" in capsys.readouterr().err
