"""A simple node beside a board: the canopen library is its master, in virtual time, by the node's own EDS."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import canopen
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.features.nodes.eds_nodes import read_node
from steptwin.features.nodes.options import NodeOptions
from steptwin.features.nodes.part import NodesPart
from steptwin.features.nodes.simple_node import SimpleNode
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.frame import Frame
from tests.messages import refusing

EDS = Path(__file__).with_name("io_module.eds")
ID = 0x40
INPUTS, OUTPUTS, TEMPERATURE, SET_POINT, DOOR = 0x6000_01, 0x6200_01, 0x2400_00, 0x2401_00, 0x2402_00
START, STOP, PRE_OPERATIONAL, RESET, RESET_COMMUNICATION = 1, 2, 128, 129, 130


@pytest.fixture
def board(fast_kernel: Kernel) -> BoardUnderTest:
    return BoardUnderTest(load_robot("lab-scara"), kernel=fast_kernel, extras=[NodeOptions(nodes={ID: EDS})])


def nodes_of(board: BoardUnderTest) -> NodesPart:
    """Return the part of a board's machine that has its further nodes."""
    part = board.parts["nodes"]
    assert isinstance(part, NodesPart)
    return part


@pytest.fixture
def node(board: BoardUnderTest) -> SimpleNode:
    return nodes_of(board).nodes[ID]


@pytest.fixture
def master(board: BoardUnderTest) -> Iterator[Any]:
    """The node as the canopen library knows it."""
    remote = canopen.RemoteNode(ID, str(EDS))
    board.network.add_node(remote)
    yield remote
    remote.remove_network()


def command(board: BoardUnderTest, specifier: int) -> None:
    board.network.send_message(0, bytes((specifier, ID)))


def frames(board: BoardUnderTest, base: int, since: int = 0) -> list[bytes]:
    """Return the data of the node's frames of a service."""
    return [frame.data for _, frame in board.bus_log[since:] if frame.cob_id == base + ID]


def test_it_boots_and_sends_its_heartbeat(board: BoardUnderTest, master: Any) -> None:
    assert frames(board, 0x700) == [b"\x00"]
    master.sdo["Producer heartbeat time"].raw = 100
    board.wait(0.35)
    assert frames(board, 0x700) == [b"\x00"] + 4 * [b"\x7f"]
    command(board, START)
    board.wait(0.1)
    assert frames(board, 0x700)[-1] == b"\x05"
    command(board, STOP)
    board.wait(0.1)
    assert frames(board, 0x700)[-1] == b"\x04"
    command(board, RESET)
    board.wait(0.3)
    assert frames(board, 0x700)[-1] == b"\x00"  # 1017h is 0 again
    # The first heartbeat waited for the answer.
    times_us = [counts // 72 for counts, frame in board.bus_log if frame.cob_id == 0x700 + ID][2:5]
    assert {b - a for a, b in pairwise(times_us)} == {100_000}


def test_sdo_reads_and_writes_each_type(master: Any) -> None:
    sdo = master.sdo
    assert sdo[0x1000].raw == 0x0003_0191
    assert sdo[0x1008].raw == "An input and output module"  # 26 bytes: segmented
    assert sdo[0x1018][1].raw == 0x1234_5678
    assert sdo[0x1400][1].raw == 0x200 + ID  # no default: the predefined connection set
    assert sdo[0x1800][1].raw == 0x4000_0180 + ID
    assert sdo[0x2400].raw == 21.5
    assert sdo[0x2405].raw == -1
    assert sdo.upload(0x6000, 0) == b"\x02"
    sdo[0x2403].raw = "crate of long screws"
    assert sdo[0x2403].raw == "crate of long screws"
    for value in (-100, 100):
        sdo[0x2401].raw = value
        assert sdo[0x2401].raw == value


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x3000, 0, b"\0", 0x0602_0000),
        (0x6200, 3, b"\0", 0x0609_0011),
        (0x6000, 1, b"\0", 0x0601_0002),
        (0x1008, 0, b"x", 0x0601_0002),
        (0x2404, 0, None, 0x0601_0001),
        (0x2401, 0, b"\x65\0", 0x0609_0031),
        (0x2401, 0, b"\x9b\xff", 0x0609_0032),
        (0x2401, 0, b"\0\0\0", 0x0607_0012),
        (0x2401, 0, b"\0", 0x0607_0013),
        (0x1003, 0, b"\1", 0x0609_0030),
        (0x1800, 2, b"\xf1", 0x0609_0030),
        (0x1800, 1, b"\x81\1\0\0", 0x0609_0030),
        (0x1A00, 0, b"\0", 0x0800_0022),
    ],
)
def test_what_it_refuses_is_aborted(master: Any, index: int, subindex: int, data: bytes | None, code: int) -> None:
    ask = master.sdo.upload if data is None else partial(master.sdo.download, data=data)
    with pytest.raises(canopen.SdoAbortedError) as caught:
        ask(index, subindex)
    assert caught.value.code == code


def test_process_data_go_by_the_mapping(board: BoardUnderTest, node: SimpleNode) -> None:
    rpdo = bytes((0x81, 0xEE, 100, 0))
    board.network.send_message(0x200 + ID, rpdo)
    assert node.value(OUTPUTS) == 0  # not OPERATIONAL
    command(board, START)
    board.wait(0.01)
    assert frames(board, 0x180) == [b"\0\0"]  # by events: once as OPERATIONAL begins
    board.network.send_message(0x200 + ID, rpdo)
    assert (node.value(OUTPUTS), node.value(SET_POINT)) == (0x81, 100)
    board.network.send_message(0x200 + ID, bytes((0x82, 0, 101, 0)))
    assert (node.value(OUTPUTS), node.value(SET_POINT), node.refused) == (0x82, 100, 1)
    node.set_value(INPUTS, 0x5A)
    board.wait(0.001)
    assert frames(board, 0x180)[1:] == [b"\x5a\0"]
    node.set_value(DOOR, 1)
    board.wait(0.003)
    assert len(frames(board, 0x180)) == 2  # within the inhibit time of 5 ms
    board.wait(0.003)
    assert frames(board, 0x180)[2:] == [b"\x5a\1"]
    board.wait(0.21)
    assert frames(board, 0x180)[3:] == 2 * [b"\x5a\1"]  # the event timer of 100 ms
    command(board, STOP)
    node.set_value(INPUTS, 0)
    board.wait(0.3)
    assert len(frames(board, 0x180)) == 5


def test_sync_asks_for_every_second_frame(board: BoardUnderTest, node: SimpleNode) -> None:
    command(board, START)
    node.set_value(TEMPERATURE, -0.5)
    for _ in range(5):
        board.network.send_message(0x80, b"")
        board.wait(0.001)
    assert frames(board, 0x280) == 2 * [bytes.fromhex("000000bf")]


def test_a_synchronous_rpdo_waits_for_sync(board: BoardUnderTest, node: SimpleNode, master: Any) -> None:
    master.sdo[0x1400][2].raw = 1
    command(board, START)
    board.network.send_message(0x200 + ID, bytes((3, 0, 4, 0)))
    assert node.value(OUTPUTS) == 0
    board.network.send_message(0x80, b"")
    assert (node.value(OUTPUTS), node.value(SET_POINT)) == (3, 4)


def test_the_mapping_can_be_changed_as_cia_301_says(board: BoardUnderTest, node: SimpleNode, master: Any) -> None:
    pdo = master.tpdo[2]
    pdo.read()
    pdo.clear()
    pdo.add_variable(0x6000, 2)
    pdo.add_variable(0x1001)
    pdo.trans_type, pdo.cob_id = 1, 0x2C1
    pdo.save()
    node.set_value(0x6000_02, 7)
    command(board, START)
    board.network.send_message(0x80, b"")
    assert [frame.data for _, frame in board.bus_log if frame.cob_id == 0x2C1] == [b"\x07\0"]
    with pytest.raises(canopen.SdoAbortedError) as caught:
        master.sdo[0x1801][2].raw = 2
    assert caught.value.code == 0x0800_0022  # only in PRE-OPERATIONAL


@pytest.mark.parametrize(("word", "code"), [(0x2403_00_08, 0x0604_0041), (0x6000_09_08, 0x0609_0011)])
def test_what_cannot_be_mapped_is_refused(master: Any, word: int, code: int) -> None:
    sdo = master.sdo
    sdo[0x1801][1].raw = 0x8000_0280 + ID
    sdo[0x1A01][0].raw = 0
    with pytest.raises(canopen.SdoAbortedError) as caught:
        sdo[0x1A01][1].raw = word
    assert caught.value.code == code


def test_an_emergency_is_sent_and_remembered(board: BoardUnderTest, node: SimpleNode, master: Any) -> None:
    for code in (0x5000, 0x4210, 0x6100):
        node.emergency(code, 9, b"\1\2")
        board.wait(0.001)
    assert frames(board, 0x80)[0] == bytes.fromhex("0050090102000000")
    assert [master.sdo[0x1003][i].raw for i in range(3)] == [2, 0x6100, 0x4210]
    assert master.sdo[0x1001].raw == 9
    master.sdo[0x1003][0].raw = 0
    assert [master.sdo[0x1003][i].raw for i in range(3)] == [0, 0, 0]
    node.emergency(0, 0)
    board.wait(0.001)
    assert frames(board, 0x80)[-1] == bytes(8)
    assert [entry.code for entry in master.emcy.log] == [0x5000, 0x4210, 0x6100, 0]
    for wrong in ((0x10000, 1, b""), (1, 256, b""), (1, 1, bytes(6))):
        with refusing(ValueError):
            node.emergency(*wrong)


def test_an_rpdo_of_wrong_length_is_told_once(board: BoardUnderTest, node: SimpleNode) -> None:
    command(board, START)
    for _ in range(2):
        board.network.send_message(0x200 + ID, b"\1\0\2")
    board.network.send_message(0x200 + ID, b"\1\0\2\0")
    board.wait(0.001)
    assert frames(board, 0x80) == [bytes.fromhex("1082100100000000"), bytes(8)]
    assert node.value(OUTPUTS) == 1


def test_a_reset_gives_the_defaults_back(board: BoardUnderTest, node: SimpleNode, master: Any) -> None:
    master.sdo[0x2401].raw = 5
    master.sdo[0x1400][2].raw = 1
    command(board, RESET_COMMUNICATION)
    assert (node.value(SET_POINT), node.value(0x1400_02)) == (5, 255)
    command(board, RESET)
    assert node.value(SET_POINT) == 0
    assert frames(board, 0x700) == 3 * [b"\0"]


def test_without_supply_it_is_silent_and_forgets(board: BoardUnderTest, node: SimpleNode, master: Any) -> None:
    master.sdo[0x1017].raw = 10
    command(board, START)
    node.set_value(INPUTS, 5)
    board.wait(0.05)
    nodes_of(board).switch(ID, on=False)
    before = len(board.bus_log)
    node.set_value(INPUTS, 6)
    node.emergency(0x5000)
    command(board, START)
    board.wait(0.3)
    assert all(frame.cob_id & 0x7F != ID for _, frame in board.bus_log[before:])
    assert not node.powered
    for on in (True, True):
        nodes_of(board).switch(ID, on=on)
    board.wait(0.05)
    assert frames(board, 0x700, before) == [b"\0"]
    assert node.value(INPUTS) == 0
    assert master.sdo[0x1017].raw == 0


def test_a_frame_breaks_off_with_the_supply(board: BoardUnderTest, node: SimpleNode) -> None:
    command(board, START)
    board.wait(0.01)
    before = len(frames(board, 0x180))
    node.set_value(INPUTS, 9)
    board.pass_time(20e-6)
    nodes_of(board).switch(ID, on=False)
    board.wait(0.01)
    assert len(frames(board, 0x180)) == before


def test_axes_and_their_motion_are_as_without_it(board: BoardUnderTest, fast_kernel: Kernel) -> None:
    alone = BoardUnderTest(load_robot("lab-scara"), kernel=fast_kernel)
    for each in (board, alone):
        each.wait(0.5)
    assert next((t, f) for t, f in board.bus_log if f.cob_id & 0x7F != ID) == alone.bus_log[0]
    assert board.joints() == alone.joints()


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from([0, 0x80, 0x200 + ID, 0x600 + ID]), st.binary(max_size=8)), max_size=20))
@settings(deadline=None)
def test_junk_from_the_bus_never_raises(junk: list[tuple[int, bytes]]) -> None:
    node = SimpleNode(read_node(ID, EDS, axes=4))
    node.boot(0)
    node.can.received(Frame(0, bytes((START, ID))), 72)
    for number, (cob_id, data) in enumerate(junk, start=2):
        node.can.received(Frame(cob_id, data), 72 * number)
        node.step(72 * number)
    node.can.received(Frame(0, bytes((RESET, 0))), 72_000_000)
    assert node.value(SET_POINT) == 0
