"""`steptwin conform`: our axis and a simple node pass; each check fails a node that does what it forbids."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.conform.check import Checked, CheckResult, Need
from steptwin.features.conform.conformance import conformance, ordered
from steptwin.features.conform.node import Description, NodeUnderTest
from steptwin.features.nodes.options import NodeOptions
from steptwin.host.client.links import Link
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.exports import render_eds
from tests.messages import refusing

AXIS: Final = 0x10
MODULE: Final = 0x40
MODULE_EDS: Final = Path(__file__).parents[1] / "nodes" / "io_module.eds"
Spoil = Callable[[int, bytes], list[bytes]]
"""What becomes of a frame of the node: the identifier and the data; a list of data, empty to lose the frame."""


class SpoiledNode(NodeUnderTest):
    """A node whose frames reach the tester otherwise than it has sent them."""

    def __init__(self, link: Link, node_id: int, described: Description, spoil: Spoil) -> None:
        self.spoil: Spoil = lambda _, data: [data]
        super().__init__(link, node_id, described)
        self.spoil = spoil

    def _received(self, cob_id: int, data: bytearray, at_s: float) -> None:
        for each in self.spoil(cob_id, bytes(data)):
            super()._received(cob_id, bytearray(each), at_s)


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Description:
    file = tmp_path_factory.mktemp("eds") / "axis.eds"
    file.write_text(render_eds(), encoding="utf-8")
    return Description.read(str(file), AXIS)


@pytest.fixture
def board(fast_kernel: Kernel) -> BoardUnderTest:
    module = NodeOptions(nodes={MODULE: MODULE_EDS})
    return BoardUnderTest(load_robot("teaching-scara"), kernel=fast_kernel, extras=[module])


def results(checked: list[Checked], result: CheckResult) -> dict[str, str]:
    return {each.check.id: each.reason for each in checked if each.result is result}


@pytest.mark.slow
def test_our_axis_passes(board: BoardUnderTest, axis: Description) -> None:
    """With motion: nothing fails. What differs is stored for this robot; SYNC has one identifier."""
    done = list(conformance(NodeUnderTest(board, AXIS, axis), list(Need)))
    assert [each.check for each in done] == ordered()
    assert results(done, CheckResult.FAILED) == {}
    assert list(results(done, CheckResult.DIFFERS)) == ["D8"]
    assert results(done, CheckResult.SKIPPED) == {"Y1": "0x1005 is read-only"}
    assert len(results(done, CheckResult.PASSED)) == 63
    assert board.violations() == []


@pytest.mark.slow
def test_without_leave_the_drive_stays_off_and_nothing_moves(board: BoardUnderTest, axis: Description) -> None:
    before = board.steps()
    done = list(conformance(NodeUnderTest(board, AXIS, axis), [Need.EDS]))
    assert results(done, CheckResult.FAILED) == {}
    skipped = results(done, CheckResult.SKIPPED)
    assert list(skipped) == ["Y1", "F1", "F2", "F4", "F10"]
    assert skipped["F1"] == "needs --enable: the drive is switched on, without motion"
    assert board.steps() == before
    assert len(board.pins("th1").clk_rise_counts) == 0


@pytest.mark.slow
def test_a_simple_node_passes(board: BoardUnderTest) -> None:
    """Its EDS has no lists of objects, which CiA 306 wants. It is no drive."""
    described = Description.read(str(MODULE_EDS), MODULE)
    done = list(conformance(NodeUnderTest(board, MODULE, described), [Need.EDS, Need.ENABLE]))
    assert results(done, CheckResult.FAILED) == {"E1": "no section [MandatoryObjects]"}
    assert results(done, CheckResult.SKIPPED)["F1"] == "0x1000 says that it is no drive"
    assert list(results(done, CheckResult.DIFFERS)) == ["E5", "P5", "M2"]


ABORTED = b"\x80"


def other_code(cob_id: int, data: bytes) -> list[bytes]:
    """Abort with the general code, as lazy servers do."""
    return [data[:4] + bytes.fromhex("00000008")] if cob_id == 0x580 + AXIS and data[:1] == ABORTED else [data]


def silent(cob_id: int, data: bytes) -> list[bytes]:
    return [] if cob_id == 0x580 + AXIS and data[:1] == ABORTED else [data]


def stuck_toggle(cob_id: int, data: bytes) -> list[bytes]:
    """Upload segments (command 0, toggle 1) lose their toggle."""
    is_segment = cob_id == 0x580 + AXIS and data[0] & 0xF0 == 0x10
    return [bytes((data[0] & 0xEF,)) + data[1:]] if is_segment else [data]


def other_vendor(_cob_id: int, data: bytes) -> list[bytes]:
    return [data[:4] + b"\x01\x02\x03\x04"] if data[:4] == bytes.fromhex("43181001") else [data]


def longer(cob_id: int, data: bytes) -> list[bytes]:
    """Values of one byte come with the size of two."""
    return [b"\x4b" + data[1:]] if cob_id == 0x580 + AXIS and data[0] == 0x4F else [data]


def boots_twice(cob_id: int, data: bytes) -> list[bytes]:
    return [data, data] if (cob_id, data) == (0x700 + AXIS, b"\0") else [data]


def stuck_guard(cob_id: int, data: bytes) -> list[bytes]:
    """The toggle bit of node guarding stays 0."""
    return [bytes((data[0] & 0x7F,))] if cob_id == 0x700 + AXIS else [data]


def no_loss(cob_id: int, data: bytes) -> list[bytes]:
    """A lost master is reported with a code of its own."""
    return [b"\x00\xff" + data[2:]] if cob_id == 0x080 + AXIS and data[:2] == b"\x30\x81" else [data]


def wrong_state(cob_id: int, data: bytes) -> list[bytes]:
    """A heartbeat that never says STOPPED."""
    return [b"\x05"] if (cob_id, data) == (0x700 + AXIS, b"\x04") else [data]


def short_pdo(cob_id: int, data: bytes) -> list[bytes]:
    return [data[:-1]] if cob_id == 0x180 + AXIS else [data]


def doubled_pdo(cob_id: int, data: bytes) -> list[bytes]:
    return [data, data] if cob_id == 0x180 + AXIS else [data]


def late_heartbeat(cob_id: int, data: bytes, seen: list[int] = []) -> list[bytes]:  # noqa: B006
    """Each second heartbeat is missing: the period is twice that of 1017h."""
    if cob_id == 0x700 + AXIS and data != b"\0":
        seen.append(0)
        return [data] if len(seen) % 2 else []
    return [data]


def never_enabled(_cob_id: int, data: bytes) -> list[bytes]:
    """The statusword says SWITCHED ON for OPERATION ENABLED."""
    if data[:4] == bytes.fromhex("4b416000"):
        return [data[:4] + bytes((data[4] & ~0x04, *data[5:]))]
    return [data]


@pytest.mark.parametrize(
    ("spoil", "check", "reason"),
    [
        (other_code, "D4", "0x2017:02 Release: takes the token of the program in charge: abort 08000000h"),
        (other_code, "D5", None),
        (other_code, "D10", None),
        (other_code, "S6", "3 bytes for two: abort 08000000h"),
        (other_code, "S8", "abort 08000000h"),
        (other_code, "P2", None),
        (other_code, "M2", "abort 08000000h"),
        (silent, "S8", "no answer"),
        (stuck_toggle, "S2", None),
        (other_vendor, "D1", None),
        (longer, "D3", None),
        (boots_twice, "H1", "2 boot-up messages after RESET_COMMUNICATION"),
        (wrong_state, "N1", "after STOP the heartbeat says 05h, not 04h"),
        (wrong_state, "H2", None),
        (stuck_guard, "H5", "the answer is 7Fh, not FFh"),
        (no_loss, "H6", "EMCY FF00h, not 8130h"),
        (late_heartbeat, "H2", "the period in OPERATIONAL is 100.0 ms, not 50"),
        (short_pdo, "P11", None),
        (doubled_pdo, "P12", "6 frames 190h at nine SYNCs"),
        (never_enabled, "F1", "000Fh leads to SWITCHED_ON, not OPERATION_ENABLED"),
    ],
    ids=lambda value: value.__name__ if callable(value) else None if value is None or len(value) > 3 else value,
)
def test_a_broken_node_fails(
    spoil: Spoil, check: str, reason: str | None, board: BoardUnderTest, axis: Description
) -> None:
    node = SpoiledNode(board, AXIS, axis, spoil)
    (done,) = conformance(node, [Need.EDS, Need.ENABLE], [check])
    assert done.result is CheckResult.FAILED
    if reason is not None:
        assert done.reason == reason
    assert done.traffic


BROKEN_EDS = [
    ("E1", "SupportedObjects=3", "SupportedObjects=4", "[MandatoryObjects] says 4 objects and lists 3"),
    ("E2", "[1017]", "[1017]\nLowLimit=1", "0x1017:00: default 0 is beyond LowLimit 1"),
    ("E3", "[1A00]", "[2A00]", None),
    ("E4", "0x60410010", "0x60410020", None),
]


@pytest.mark.parametrize(("check", "text", "instead", "reason"), BROKEN_EDS, ids=[row[0] for row in BROKEN_EDS])
def test_an_eds_that_contradicts_itself_fails(
    check: str, text: str, instead: str, reason: str | None, board: BoardUnderTest, tmp_path: Path
) -> None:
    eds = render_eds()
    assert text in eds
    file = tmp_path / "broken.eds"
    file.write_text(eds.replace(text, instead, 1), encoding="utf-8")
    described = Description.read(str(file), AXIS)
    (done,) = conformance(NodeUnderTest(board, AXIS, described), [Need.EDS], [check])
    assert done.result is CheckResult.FAILED
    if reason is not None:
        assert done.reason == reason


def test_a_node_that_is_not_there_a_drive_that_is_on_and_another_master_are_refused(
    board: BoardUnderTest, axis: Description
) -> None:
    with refusing(InputError):
        list(conformance(NodeUnderTest(board, 0x22), []))
    node = NodeUnderTest(board, AXIS, axis)
    for word in (0x06, 0x07, 0x0F):
        node.control(word)
    with refusing(InputError):
        list(conformance(node, []))
    node.control(0)
    busy = NodeUnderTest(board, AXIS, axis)
    board.network.notify(0x600 + AXIS, bytearray(8), 0.0)
    with refusing(InputError):
        list(conformance(busy, []))


def test_each_check_has_an_id_of_its_own_and_a_title_that_is_one_line() -> None:
    checks = ordered()
    assert len({check.id for check in checks}) == len(checks) == 65
    assert all(check.title and "\n" not in check.title and check.clause for check in checks)
