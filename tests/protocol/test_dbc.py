"""The CAN database, read by cantools: messages, signals, units and value names."""

from typing import Any

import cantools
import pytest
from cantools.database.can import Database

from steptwin.protocol.dbc import AxisNames, render_dbc
from steptwin.protocol.frame import COB_EMCY, COB_TPDO
from steptwin.protocol.objects import ENTRIES, RPDO_DEFAULTS, TPDO_DEFAULTS
from steptwin.protocol.pvt import PvtRecord

SLIDE = AxisNames("sx", "mm", 655_360.0 / 16)
PLAIN = AxisNames("Axis1")


@pytest.fixture(scope="module")
def database() -> Database:
    loaded = cantools.database.load_string(render_dbc((SLIDE, PLAIN)), "dbc")
    assert isinstance(loaded, Database)
    return loaded


def test_every_default_pdo_of_every_axis_is_there(database: Database) -> None:
    for node_id in (0x10, 0x11):
        for base, mappings in (
            ((0x200, 0x300, 0x400, 0x500), [pdo.mapping for pdo in RPDO_DEFAULTS]),
            ((0x180, 0x280, 0x380, 0x480), [pdo.mapping for pdo in TPDO_DEFAULTS]),
        ):
            for cob_id, mapping in zip(base, mappings, strict=True):
                message = database.get_message_by_frame_id(cob_id + node_id)
                types = [ENTRIES[address].data_type for address in mapping]
                assert message.length == sum(kind.size for kind in types)
                assert [(s.start, s.length) for s in message.signals] == _places([8 * kind.size for kind in types])
                assert [s.is_signed for s in message.signals] == [kind.signed for kind in types]


def decode(database: Database, cob_id: int, data: bytes) -> dict[str, Any]:
    decoded = database.decode_message(cob_id, data)
    assert isinstance(decoded, dict)
    return decoded


def _places(widths: list[int]) -> list[tuple[int, int]]:
    places, first = [], 0
    for bits in widths:
        places.append((first, bits))
        first += bits
    return places


def test_a_record_decodes_in_the_axis_units(database: Database) -> None:
    data = PvtRecord(-40_960, 64 * 41, 10, 200).encode()
    decoded = decode(database, 0x510, data)
    assert decoded["Displacement"] == pytest.approx(-1.0)  # 40 960 units are 1 mm
    assert decoded["EndVelocity"] == pytest.approx(41 * 1000 / 40_960)  # 41 units/ms, in mm/s
    assert (decoded["Duration"], decoded["SequenceNumber"]) == (10, 200)
    message = database.get_message_by_frame_id(0x510)
    assert [signal.unit for signal in message.signals] == ["mm", "mm/s", "ms", None]
    assert decode(database, 0x511, data)["Displacement"] == -40_960
    assert database.get_message_by_frame_id(0x511).signals[0].unit == "1/16384 full step"


def test_status_emergency_heartbeat_and_nmt(database: Database) -> None:
    status = decode(database, COB_TPDO[0] + 0x10, bytes.fromhex("37160700A00000"))
    assert status["Statusword"] == 0x1637
    assert status["PositionActualValue"] == pytest.approx(1.0)
    emergency = decode(database, COB_EMCY + 0x11, bytes.fromhex("01FF810000000000"))
    assert (emergency["ErrorCode"], emergency["ErrorRegister"]) == (0xFF01, 0x81)
    assert str(decode(database, 0x710, b"\x05")["NmtState"]) == "OPERATIONAL"
    assert str(decode(database, 0x77F, b"\x05")["NmtState"]) == "OPERATIONAL"
    assert str(decode(database, 0, b"\x01\x00")["Command"]) == "START"


def test_senders_and_names(database: Database) -> None:
    assert [node.name for node in database.nodes] == ["Master", "sx", "Axis1"]
    assert database.get_message_by_frame_id(0x190).senders == ["sx"]
    assert database.get_message_by_frame_id(0x190).name == "sx_TPDO1_Status"
    assert database.get_message_by_frame_id(0x610).senders == ["Master"]
    assert database.get_message_by_frame_id(0x77F).senders == ["Master"]
    assert len({message.name for message in database.messages}) == len(database.messages)
