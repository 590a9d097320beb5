"""`doctor`: each check passes on a healthy machine and names the fault of an unfit one; an absent server."""

import json

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client.links import bus_link
from steptwin.host.common.errors import BusError
from steptwin.host.operate.doctor import examine
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from tests.host.client.machines import TH2, TH3
from tests.host.operate.sessions import ROBOT, CommandLine
from tests.operations import Supply


def test_a_healthy_machine(steptwin: CommandLine, session: Session) -> None:
    exit_code, out, err = steptwin.run("doctor warehouse-scara")
    assert (exit_code, err) == (0, "")
    lines = out.splitlines()
    assert all(line.startswith("[ OK ] ") for line in lines)
    assert lines[0] == "[ OK ] bus: 127.0.0.1:29536"
    assert lines[1].startswith("[ OK ] sx node 0x10: type 0x00040192, StepTwin stepper axis (SIMULATED), ")
    assert len(lines) == 1 + len(ROBOT.joints) * 9
    assert session.machine.axes[0].read(od.STATUSWORD)


def test_what_is_wrong_is_named(steptwin: CommandLine, session: Session) -> None:
    axis = session.machine.axes[TH2]
    axis.write(od.SUPPLY_VOLTAGE_MIN, 5000)
    axis.write(od.BOARD_TEMPERATURE_MAX, -500)
    document_code, out, err = steptwin.run("doctor warehouse-scara --json")
    assert (document_code, err) == (3, "")
    failed = {check["name"]: check["found"] for check in json.loads(out)["checks"] if not check["passed"]}
    assert failed == {
        "th2 supply": "24.00 V, 50 to 34 V allowed",
        "th2 temperature": "25.0 degC, up to -50 degC allowed",
    }


def test_other_drivers_are_told_with_their_own_supply(fast_kernel: Kernel) -> None:
    """The board's own name and limits are those of a TB6560; an A4988 takes 8 to 35 V, by its datasheet."""
    robot = load_robot("corexy-gantry")
    board = EmbeddedBoard(robot, fast_kernel)
    session = Session(board, robot)
    checks = {check.name: check for check in examine(session)}
    assert checks["Z2 settings"].passed  # a second motor has settings of its own
    assert checks["X node 0x10"].found.endswith("; its drivers are a4988 by the robot's file")
    assert checks["X supply"] == ("X supply", True, "24.00 V, 10 to 34 V allowed; a4988 takes 8 to 35 V", 3)
    session.machine.axes[0].write(od.SUPPLY_VOLTAGE_MAX, 5000)
    board.operate(Supply(3600))
    check = next(check for check in examine(session) if check.name == "X supply")
    assert (check.passed, check.found) == (False, "36.00 V, 10 to 50 V allowed; a4988 takes 8 to 35 V")


def test_unknown_positions_fail(steptwin: CommandLine) -> None:
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 3
    failed = [line for line in out.splitlines() if line.startswith("[FAIL] ")]
    assert failed == [
        f"[FAIL] {name} position: unknown: home the machine, `steptwin home`" for name in ROBOT.joint_names
    ]


def test_settings_that_need_the_power_off(session: Session) -> None:
    """Another robot's microsteps pass while the drive is off, since the next motion writes the right ones."""
    axis = session.machine.axes[TH3]
    session.machine.disable()
    axis.write(od.MICROSTEPS, 8)
    checks = {check.name: check for check in examine(session)}
    assert checks["th3 settings"].passed
    session.machine.enable()
    checks = {check.name: check for check in examine(session)}
    assert not checks["th3 settings"].passed
    assert checks["th3 settings"].found == (
        "driver and board make 8 microsteps, the robot's file says 16, and the power is on: `steptwin estop`"
    )


def test_a_node_that_does_not_answer(
    steptwin: CommandLine, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    send = board.network.send_message

    def without_th3(can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id != 0x615:
            send(can_id, data, remote)

    monkeypatch.setattr(board.network, "send_message", without_th3)
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 4
    assert "[FAIL] th3 node 0x15: does not answer" in out


def test_an_absent_server(steptwin: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise BusError("127.0.0.1:29536: Connection refused")

    monkeypatch.setattr(bus_link, "open_bus", refuse)
    assert steptwin.run("doctor warehouse-scara") == (4, "[FAIL] bus: 127.0.0.1:29536: Connection refused\n", "")
    refused = "steptwin: 127.0.0.1:29536: Connection refused\n"
    for command in ("status", "reset", "resume", "home", "outputs"):
        assert steptwin.run(f"{command} warehouse-scara") == (4, "", refused)
    unsure = refused.replace("\n", "; nobody knows whether the machine has stopped: use its own e-stop\n")
    for command in ("stop", "estop", "pause"):
        assert steptwin.run(f"{command} warehouse-scara") == (4, "", unsure)
    assert steptwin.run("move warehouse-scara sx=1") == (4, "", refused)
    assert steptwin.run("jog warehouse-scara sx 1") == (4, "", refused)
    assert steptwin.run("run warehouse-scara pull-line") == (4, "", refused)
    assert steptwin.run("monitor") == (4, "", refused)
