"""What looks on and what small things are done: status, doctor, outputs, homing."""

import json

import pytest

from steptwin.host.client import bus_link
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.operate.doctor import examine
from steptwin.host.operate.homing import declare
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.operate.switching import switch_output
from steptwin.host.twin.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalOutput
from tests.host.operate.sessions import HOME, ROBOT, TH2, TH3, CommandLine

HOME_TEXT = " ".join(map(str, HOME))


# --- status


def test_a_machine_after_power_up(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    """Nothing on it changes: no network management, and no write."""
    begin = len(board.bus_log)
    document = steptwin.json("status warehouse-scara")
    sent = [frame for _, frame in board.bus_log[begin:]]
    assert not [frame for frame in sent if frame.cob_id == 0]
    assert not [frame for frame in sent if 0x600 < frame.cob_id < 0x680 and frame.data[0] >> 5 == 1]
    assert document["pose"] is None
    assert [axis["name"] for axis in document["axes"]] == list(ROBOT.joint_names)
    axis = document["axes"][TH2]
    assert (axis["operational"], axis["state"], axis["position_known"]) == (False, "SWITCH ON DISABLED", False)
    assert (axis["error"], axis["history"], axis["moving"]) == (None, [], False)
    assert axis["queue"] == {
        "free": 64,
        "flags": ["empty"],
        "accepted": 0,
        "gaps": 0,
        "overflows": 0,
        "underruns": 0,
        "least_fill": axis["queue"]["least_fill"],
        "delayed_steps": 0,
    }


def test_a_machine_that_knows_where_it_is(steptwin: CommandLine, session: Session) -> None:
    document = steptwin.json("status warehouse-scara")
    pose = session.pose(HOME)
    assert pose is not None
    assert document["pose"] == pytest.approx(pose, abs=0.1)
    assert [axis["position"] for axis in document["axes"]] == pytest.approx(HOME, abs=0.02)
    exit_code, out, err = steptwin.run("status warehouse-scara")
    assert (exit_code, err) == (0, "")
    assert "OPERATION ENABLED" in out
    assert "tool: x " in out


@pytest.mark.usefixtures("session")
def test_a_queue_that_takes_nothing_is_closed(steptwin: CommandLine) -> None:
    assert steptwin.run("move warehouse-scara th1=5")[0] == 0
    assert "th1: process data; queue closed (empty); " in steptwin.run("status warehouse-scara")[1]


def test_a_fault_is_the_exit_code(steptwin: CommandLine, session: Session) -> None:
    session.machine.disable()
    session.machine.axes[TH2].write(od.SUPPLY_VOLTAGE_MIN, 5000)  # no supply has 50 V
    session.machine.axes[TH2].write(od.CONTROLWORD, 6)
    session.machine.axes[TH2].write(od.CONTROLWORD, 7)
    exit_code, out, err = steptwin.run("status warehouse-scara --json")
    assert (exit_code, err) == (3, "steptwin: th2: the drive is in FAULT: undervoltage\n")
    assert json.loads(out)["axes"][TH2]["history"] == ["undervoltage (0x3220)"]


def test_watching_is_for_people(steptwin: CommandLine) -> None:
    exit_code, _, err = steptwin.run("status warehouse-scara --watch --json")
    assert exit_code == 2
    assert err.startswith("steptwin: --watch and --json: give only one of them")


def test_watching_goes_on_until_ctrl_c(
    steptwin: CommandLine, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait, looks = board.wait, []

    def wait_or_interrupt(dt_s: float) -> None:
        if dt_s > 0.1:
            looks.append(dt_s)
            if len(looks) == 3:
                raise KeyboardInterrupt
        wait(dt_s)

    monkeypatch.setattr(board, "wait", wait_or_interrupt)
    exit_code, out, err = steptwin.run("status warehouse-scara --watch")
    assert (exit_code, err) == (130, "")
    assert out.count("tool: unknown") == 3


def test_nobody_there(board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board.network, "send_message", lambda *_: None)
    with pytest.raises(BusError, match=r"^sx: node 0x10 does not answer"):
        read_status(Session(board, ROBOT))


# --- doctor


def test_a_healthy_machine(steptwin: CommandLine, session: Session) -> None:
    exit_code, out, err = steptwin.run("doctor warehouse-scara")
    assert (exit_code, err) == (0, "")
    lines = out.splitlines()
    assert all(line.startswith("[ OK ] ") for line in lines)
    assert lines[0] == "[ OK ] bus: 127.0.0.1:29536"
    assert lines[1].startswith("[ OK ] sx node 0x10: type 0x00040192, StepTwin TB6560 axis (SIMULATED), ")
    assert len(lines) == 1 + len(ROBOT.joints) * 7
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


def test_unknown_positions_fail(steptwin: CommandLine) -> None:
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 3
    failed = [line for line in out.splitlines() if line.startswith("[FAIL] ")]
    assert failed == [
        f"[FAIL] {name} position: unknown: home the machine, `steptwin home`" for name in ROBOT.joint_names
    ]


def test_settings_that_need_the_power_off(session: Session) -> None:
    """Microsteps of another robot: no matter while the drive is off, since the next motion writes them."""
    axis = session.machine.axes[TH3]
    session.machine.disable()
    axis.write(od.MICROSTEPS, 8)
    checks = {check.name: check for check in examine(session)}
    assert checks["th3 settings"].passed
    session.machine.enable()
    checks = {check.name: check for check in examine(session)}
    assert not checks["th3 settings"].passed
    assert checks["th3 settings"].found.startswith("8 microsteps, the robot's file says 16")


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
    assert "[FAIL] th3 node 0x15: th3: node 0x15 does not answer" in out


def test_an_absent_server(steptwin: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise BusError("127.0.0.1:29536: Connection refused")

    monkeypatch.setattr(bus_link, "open_bus", refuse)
    assert steptwin.run("doctor warehouse-scara") == (4, "[FAIL] bus: 127.0.0.1:29536: Connection refused\n", "")
    refused = "steptwin: 127.0.0.1:29536: Connection refused\n"
    for command in ("status", "stop", "estop", "reset", "pause", "resume", "home", "outputs"):
        assert steptwin.run(f"{command} warehouse-scara") == (4, "", refused)
    assert steptwin.run("move warehouse-scara sx=1") == (4, "", refused)
    assert steptwin.run("jog warehouse-scara sx 1") == (4, "", refused)
    assert steptwin.run("run warehouse-scara drawer-pull") == (4, "", refused)
    assert steptwin.run("monitor") == (4, "", refused)


# --- outputs


def test_outputs_by_name(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    assert steptwin.json("outputs warehouse-scara")["outputs"] == {"magnet": False, "lock": False}
    assert steptwin.json("outputs warehouse-scara lock on")["outputs"] == {"magnet": False, "lock": True}
    axis = Session(board, ROBOT).machine.axes[TH3]
    assert axis.read(od.DIGITAL_OUTPUTS) == DigitalOutput.OUT2
    exit_code, out, _ = steptwin.run("outputs warehouse-scara")
    assert (exit_code, out.split()[-8:]) == (0, ["magnet", "th3", "OUT1", "off", "lock", "th3", "OUT2", "on"])
    assert steptwin.json("outputs warehouse-scara lock off")["outputs"] == {"magnet": False, "lock": False}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("magnets on", "output of warehouse-scara 'magnets' is unknown: did you mean magnet?"),
        ("magnet", "after the robot: nothing, or NAME and on or off, not magnet"),
        ("magnet 1", "after the robot: nothing, or NAME and on or off, not magnet 1"),
    ],
)
def test_outputs_that_do_not_exist(steptwin: CommandLine, words: str, message: str) -> None:
    assert steptwin.run(f"outputs warehouse-scara {words}") == (2, "", f"steptwin: {message}\n")


def test_an_output_of_no_name_is_not_switched(board: EmbeddedBoard) -> None:
    with pytest.raises(InputError, match=r"^output of warehouse-scara 'gripper' is unknown: "):
        switch_output(Session(board, ROBOT), "gripper", on=True)


# --- homing


def test_homing_ends_at_home(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    document = steptwin.json("home warehouse-scara --together")
    assert all(axis["position_known"] for axis in document["axes"])
    assert [axis["position"] for axis in document["axes"]] == pytest.approx(HOME, abs=0.05)
    counted = [steps / spu for steps, spu in zip(board.driver_positions(), ROBOT.steps_per_unit, strict=True)]
    assert counted == pytest.approx(HOME, abs=0.05)
    move(Session(board, ROBOT), HOME)


def test_the_machine_may_stay_at_its_switches(steptwin: CommandLine) -> None:
    document = steptwin.json("home warehouse-scara --together --stay")
    assert all(axis["position_known"] for axis in document["axes"])
    assert [axis["position"] for axis in document["axes"]] != pytest.approx(HOME, abs=0.05)


def test_telling_it_where_it_stands(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    before = board.driver_positions()
    document = steptwin.json(f"home warehouse-scara --here '{HOME_TEXT}'")
    assert all(axis["position_known"] for axis in document["axes"])
    assert board.driver_positions() == before
    assert steptwin.run("home warehouse-scara --here '1 2' ")[0] == 2
    assert steptwin.run(f"home warehouse-scara --here '{HOME_TEXT}' --stay")[0] == 2
    with pytest.raises(InputError, match=r"^sx: .* is outside "):
        declare(Session(board, ROBOT), [-5000.0, *HOME[1:]])


# --- which board


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("", "which board? --connect HOST:PORT, or -i INTERFACE -c CHANNEL"),
        ("--connect 1.2.3.4:", "--connect 1.2.3.4:: is not of the form HOST:PORT, such as 127.0.0.1:29536"),
        ("--connect 1.2.3.4:65536", "--connect 1.2.3.4:65536: is not of the form HOST:PORT, such as 127.0.0.1:29536"),
        ("--connect a:1 -i virtual", "--connect a:1 and --interface virtual: give only one of them"),
        ("-i socketcam", "--interface 'socketcam' is unknown: did you mean socketcan or socketcand?"),
        ("-c can0", "--channel can0: is for a live board: --connect HOST:PORT or --interface NAME"),
        ("-b 500000", "--bitrate 500000: is for a live board: --connect HOST:PORT or --interface NAME"),
        (
            "--connect 127.0.0.1:29536 -b 500000",
            "--bitrate 500000: is for --interface; the server of --connect has its own",
        ),
        ("-i virtual -b 0", "--bitrate 0: is not above 0 bit/s"),
    ],
)
def test_connections_that_are_none(capsys: pytest.CaptureFixture[str], options: str, message: str) -> None:
    from steptwin.host.cli.app import run

    assert run(["status", "warehouse-scara", *options.split()]) == 2
    assert capsys.readouterr() == ("", f"steptwin: {message}\n")
