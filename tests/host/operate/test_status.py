"""`status`: after power-up, with known positions, with a fault, watching, without an answer."""

import json
import re
from collections.abc import Callable

import pytest

from steptwin.host.common.errors import BusError
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.emergency import PLACES as EMCY_PLACES
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_NO_RTR, COB_NMT, COB_RPDO, COB_TPDO
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.objects import ASYNCHRONOUS
from tests.host.client.machines import TH2, sdo_requests
from tests.host.operate.sessions import HOME, ROBOT, CommandLine
from tests.messages import refusing

LOOKS = 3


def test_a_machine_after_power_up(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    """`status` changes nothing: it sends no NMT command and no SDO write."""
    begin = len(board.bus_log)
    document = steptwin.json("status warehouse-scara")
    sent = [frame for _, frame in board.bus_log[begin:]]
    assert not [frame for frame in sent if frame.cob_id == 0]
    assert not [frame for frame in sdo_requests(board, begin) if frame.data[0] >> 5 == 1]
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
    assert (axis["frames_lost"], axis["emergencies_lost"]) == (0, 0)


def test_a_machine_of_known_position(steptwin: CommandLine, session: Session) -> None:
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
    session.machine.axes[TH2].write(od.SUPPLY_VOLTAGE_MIN, 5000)  # above the 24 V of the supply
    session.machine.axes[TH2].write(od.CONTROLWORD, 6)
    session.machine.axes[TH2].write(od.CONTROLWORD, 7)
    exit_code, out, err = steptwin.run("status warehouse-scara --json")
    assert (exit_code, err) == (3, "steptwin: th2: the drive is in FAULT: undervoltage\n")
    assert json.loads(out)["axes"][TH2]["history"] == ["undervoltage (0x3220)"]


@pytest.mark.slow
def test_a_board_that_had_too_much_to_send(steptwin: CommandLine, session: Session, board: EmbeddedBoard) -> None:
    """All TPDOs every millisecond, and EMCYs so far apart that they do not fit into their queue."""
    network = board.network
    network.send_message(COB_NMT, bytes((NmtCommand.ENTER_PRE_OPERATIONAL, 0)))
    for axis in session.machine.axes:
        axis.write(od.EMCY_INHIBIT_TIME, 0xFFFF)
        for number, place in enumerate(od.TPDO_COMMUNICATION):
            cob_id = COB_ID_NO_RTR | COB_TPDO[number] + axis.node_id
            axis.write(od.address_of(place, od.PDO_COB_ID), COB_ID_INVALID | cob_id)
            axis.write(od.address_of(place, od.PDO_TRANSMISSION_TYPE), ASYNCHRONOUS)
            axis.write(od.address_of(place, od.PDO_INHIBIT_TIME), 0)
            axis.write(od.address_of(place, od.PDO_EVENT_TIMER), 1)
            axis.write(od.address_of(place, od.PDO_COB_ID), cob_id)
    network.send_message(COB_NMT, bytes((NmtCommand.START, 0)))
    node_id = session.machine.axes[TH2].node_id
    for _ in range(EMCY_PLACES):
        network.send_message(COB_RPDO[2] + node_id, b"")
        network.send_message(COB_RPDO[2] + node_id, bytes(4))
    network.send_message(COB_NMT, bytes((NmtCommand.ENTER_PRE_OPERATIONAL, 0)))
    axis_status = steptwin.json("status warehouse-scara")["axes"][TH2]
    frames, emergencies = axis_status["frames_lost"], axis_status["emergencies_lost"]
    assert frames > 0
    assert emergencies >= EMCY_PLACES
    out = steptwin.run("status warehouse-scara")[1]
    said = f"{frames} frames of the board lost, the bus was too busy; {emergencies} EMCYs lost, too many waited"
    assert said in out


@pytest.fixture
def watched(steptwin: CommandLine, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Return a function that runs `status --watch` for three looks and returns what it printed until Ctrl-C."""

    def watch(options: str = "") -> str:
        wait, looks = board.wait, list[float]()

        def wait_or_interrupt(dt_s: float) -> None:
            if dt_s > 0.1:
                looks.append(dt_s)
                if len(looks) == LOOKS:
                    raise KeyboardInterrupt
            wait(dt_s)

        monkeypatch.setattr(board, "wait", wait_or_interrupt)
        exit_code, out, err = steptwin.run(f"status warehouse-scara --watch {options}")
        assert (exit_code, err) == (130, "")
        return out

    return watch


def on_a_screen(text: str) -> list[str]:
    """Return what a terminal shows after this text, which moves its cursor only up and to the beginning of a line."""
    lines, row = [""], 0
    for code, plain in re.findall(r"\x1b\[([?0-9;]*[A-Za-z])|([^\x1b])", text):
        if code == "1A":
            row -= 1
        elif code == "2K" or plain == "\r":
            lines[row] = ""
        elif plain == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        else:
            lines[row] += plain
    return lines


def test_watching_prints_one_below_the_other_in_a_pipe(watched: Callable[..., str]) -> None:
    out = watched()
    assert out.count("tool: unknown") == LOOKS
    assert "\x1b" not in out


@pytest.mark.parametrize("columns", [80, 120])
def test_watching_refreshes_in_place_on_a_terminal(
    watched: Callable[..., str], monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich then takes stdout for a terminal
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("LINES", "50")
    out = watched()
    assert out.count("tool: unknown") >= LOOKS
    shown = on_a_screen(out)
    assert [line.startswith("tool:") for line in shown].count(True) == 1
    assert max(map(len, shown)) <= columns


@pytest.mark.slow
def test_watching_as_json_prints_a_document_a_line(watched: Callable[..., str]) -> None:
    documents = [json.loads(line) for line in watched("--json").splitlines()]
    assert [document["robot"] for document in documents] == ["warehouse-scara"] * LOOKS


def test_no_node_answers(board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board.network, "send_message", lambda *_: None)
    with refusing(BusError):
        read_status(Session(board, ROBOT))
