"""Decoded frames: expected lines, any junk on the bus, and the command on a bus in memory."""

import json
import threading

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.client.monitor import SERVICES, Decoder
from steptwin.host.operate.moving import move
from tests.host.operate.sessions import HOME, ROBOT, board_at, preset

DECODER = Decoder(dict(enumerate(ROBOT.joint_names, start=0x10)))


@pytest.mark.parametrize(
    ("cob_id", "data", "service", "node", "text"),
    [
        (0x000, "0100", "nmt", "all", "start"),
        (0x000, "8011", "nmt", "sz", "enter pre operational"),
        (0x000, "07", "nmt", "all", "malformed: 07"),
        (0x080, "", "sync", "all", ""),
        (0x080, "05", "sync", "all", "counter 5"),
        (0x094, "2032 05 0000000000", "emcy", "th2", "undervoltage (0x3220), register 0x05, detail 0"),
        (
            *(0x094, "1081 11 0100000000", "emcy", "th2"),
            "can overrun (0x8110), register 0x11, detail 1 (transmit queue)",
        ),
        (0x094, "1081 11 0900000000", "emcy", "th2", "can overrun (0x8110), register 0x11, detail 9"),
        (0x094, "0000 00 0000000000", "emcy", "th2", "no error (0x0000), register 0x00, detail 0"),
        (0x100, "0102", "time", "all", "01 02"),
        (
            0x193,
            "3716 07 00fcffff",
            "tpdo",
            "th1",
            "Statusword 0x1637 OPERATION ENABLED, Modes of operation display 7 interpolated position, "
            "Position actual value -1024",
        ),
        (0x193, "3716 07", "tpdo", "th1", "too short: 37 16 07"),
        (0x215, "0f00 01", "rpdo", "th3", "Controlword 0x000F, Modes of operation 1 profile position"),
        (
            0x510,
            "ffffff 400000 0a 07",
            "rpdo",
            "sx",
            "Displacement in units -1, End velocity in 1/64 unit per ms 64, Duration in ms 10, "
            "Sequence number: writing it queues the record 7",
        ),
        (0x610, "40 0010 00 00000000", "sdo", "sx", "1000:00 Device type read"),
        (0x590, "43 0010 00 92010400", "sdo", "sx", "1000:00 Device type is 0x40192"),
        (0x610, "2f 6060 00 07000000", "sdo", "sx", "6060:00 Modes of operation write 7 interpolated position"),
        (0x590, "60 6060 00 00000000", "sdo", "sx", "6060:00 Modes of operation written"),
        (
            0x590,
            "80 0020 01 22000008",
            "sdo",
            "sx",
            "2000:01 Microsteps per full step aborted: device state (0x08000022)",
        ),
        (
            0x590,
            "41 0810 00 20000000",
            "sdo",
            "sx",
            "1008:00 Manufacturer device name is in segments of 32 bytes together",
        ),
        (0x590, "00 5374657054776e", "sdo", "sx", "upload segment"),
        (0x610, "40", "sdo", "sx", "malformed: 1 bytes"),
        (0x710, "00", "heartbeat", "sx", "boot-up"),
        (0x77F, "05", "heartbeat", "host", "OPERATIONAL"),
        (0x7E5, "01", "other", "-", "01"),
        (0x120, "01", "other", "-", "01"),
        (0x720, "7f", "heartbeat", "0x20", "PRE-OPERATIONAL"),
    ],
)
def test_golden(cob_id: int, data: str, service: str, node: str, text: str) -> None:
    decoded = DECODER.decode(cob_id, bytes.fromhex(data))
    assert (decoded.service, decoded.node, decoded.text) == (service, node, text)


@given(cob_id=st.integers(0, 0x7FF), data=st.binary(max_size=8))
def test_junk_is_shown_never_raises(cob_id: int, data: bytes) -> None:
    decoded = DECODER.decode(cob_id, data)
    assert decoded.service in SERVICES
    assert "\n" not in decoded.text


def test_the_fields_of_a_real_session(fast_kernel: Kernel) -> None:
    """The last decoded TPDO1 of each axis gives its position."""
    board = board_at(HOME, fast_kernel)
    session = preset(board, HOME)
    move(session, [20.0, *ROBOT.home[1:]])
    board.wait(0.5)
    last = {}
    for _, frame in board.bus_log:
        decoded = DECODER.decode(frame.cob_id, frame.data)
        assert not decoded.text.startswith(("malformed", "too short"))
        if decoded.title == "TPDO1":
            last[decoded.node] = {field["name"]: field["value"] for field in decoded.fields}
    positions = [last[name]["Position actual value"] for name in ROBOT.joint_names]
    assert positions == session.machine.positions_units()


def monitored(arguments: str, frames: list[tuple[int, bytes]]) -> int:
    """Return the exit code of a monitor to which these frames are sent again and again until it ends."""
    done = threading.Event()
    with can.Bus(interface="virtual", channel="test-monitor") as bus:

        def send() -> None:
            while not done.wait(0.005):
                for cob_id, data in frames:
                    bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
                bus.send(can.Message(arbitration_id=0x12345, data=b"", is_extended_id=True))

        sender = threading.Thread(target=send)
        sender.start()
        try:
            return run(["monitor", *arguments.split(), "-i", "virtual", "-c", "test-monitor"])
        finally:
            done.set()
            sender.join()


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    frames = [(0x080, b""), (0x713, b"\x05"), (0x714, b"\x05"), (0x094, bytes.fromhex("2032050000000000"))]
    assert monitored("warehouse-scara --node th2 --count 2 --json", frames) == 0
    shown = json.loads(capsys.readouterr().out)["frames"]
    assert sorted((frame["service"], frame["node"], frame["node_id"]) for frame in shown) == [
        ("emcy", "th2", 0x14),
        ("heartbeat", "th2", 0x14),
    ]
    assert monitored("--service heartbeat --node 0x13 --count 1", frames) == 0
    out, err = capsys.readouterr()
    assert (out.split()[1:], err) == (["713", "HEARTBEAT", "0x13", "OPERATIONAL"], "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--service pdo", "--service 'pdo' is unknown: did you mean tpdo or rpdo"),
        ("warehouse-scara --node th9", "--node 'th9' is unknown: did you mean th"),
        ("--node 0", "--node 0: node ids are from 1 to 127"),
        ("--node 0x80", "--node 0x80: node ids are from 1 to 127"),
        ("--count 0", "--count 0: is not above 0 and finite"),
        ("--seconds -1", "--seconds -1: is not above 0 and finite"),
        ("", "which board? "),
    ],
)
def test_bad_input(capsys: pytest.CaptureFixture[str], arguments: str, message: str) -> None:
    assert run(["monitor", *arguments.split()]) == 2
    assert capsys.readouterr().err.startswith(f"steptwin: {message}")
