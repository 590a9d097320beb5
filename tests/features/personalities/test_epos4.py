"""Masters for maxon's EPOS4 run unmodified on the personality epos4."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol.cia402 import State
from steptwin.protocol.nmt import NmtCommand
from tests.features.personalities.bench_drive import BenchDrive, Write, at, pdo

REVOLUTION = 3_276_800
INCREMENT = REVOLUTION // 3200
"""Wire units."""

ROS2: list[Write] = [
    (at("1017"), 2000),
    *pdo(0x1400, 0x210, [("6040", 16), ("607A", 32), ("6060", 8)], 1),
    *pdo(0x1800, 0x190, [("6041", 16), ("6064", 32), ("6061", 8)], 1),
    (at("6040"), 0x80),
    (at("6040"), 0x06),
    (at("6040"), 0x07),
    (at("60C2:01"), 50),
    (at("60C2:02"), -3),
    (at("6081"), 1000),
    (at("6083"), 2000),
    (at("6098"), 37),
    (at("6060"), 1),
]
"""The 26 writes of maxon's ROS 2 configuration, in lely's order."""


@pytest.fixture
def drive(fast_kernel: Kernel) -> BenchDrive:
    return BenchDrive(fast_kernel, "epos4")


def cycle(drive: BenchDrive, word: int, target: int, mode: int) -> tuple[int, int, int]:
    """A cycle of ros2_canopen: RPDO1, SYNC; return what TPDO1 shows: statusword, position, mode."""
    data = word.to_bytes(2, "little") + target.to_bytes(4, "little", signed=True) + bytes((mode,))
    drive.send(0x210, data)
    drive.send(0x080, b"")
    drive.wait(50)
    shown = drive.last(0x190)
    return int.from_bytes(shown[:2], "little"), int.from_bytes(shown[2:6], "little", signed=True), shown[6]


def test_maxons_ros_2_configuration_is_accepted_and_moves_at_its_speed(drive: BenchDrive) -> None:
    assert len(ROS2) == 26
    assert drive.write_all(ROS2) == {}
    drive.nmt(NmtCommand.START)
    cycle(drive, 0x0F, 0, 1)
    assert drive.state() is State.OPERATION_ENABLED
    target = 64_000
    cycle(drive, 0x1F, target, 1)
    top = drive.top_speed(2500)
    assert top == pytest.approx(1000 / 60 * REVOLUTION, rel=1e-3), "6081 = 1000 rpm"
    status, position, mode = cycle(drive, 0x0F, target, 1)
    assert (position, mode) == (target, 1)
    assert status & 0x0400


def test_the_accelerations_are_in_rpm_per_second(drive: BenchDrive) -> None:
    drive.write_all(ROS2)
    drive.nmt(NmtCommand.START)
    cycle(drive, 0x0F, 0, 1)
    drive.send(0x210, (0x1F).to_bytes(2, "little") + (640_000).to_bytes(4, "little") + b"\1")
    drive.send(0x080, b"")
    drive.wait(250)
    assert drive.get("606C") == pytest.approx(500, rel=0.05), "2000 rpm/s for a quarter of a second"


def test_homing_as_ros2_canopen_does_it(drive: BenchDrive) -> None:
    drive.write_all(ROS2)
    drive.nmt(NmtCommand.START)
    status, _, mode = cycle(drive, 0x0F, 0, 6)
    assert (mode, status & 0x0400) == (6, 0x0400), "bit 10 before the start"
    status, position, _ = cycle(drive, 0x1F, 0, 6)
    assert status & 0x3400 == 0x1400
    assert position == 0
    _, _, mode = cycle(drive, 0x0F, 0, 0)
    assert mode == 0


def test_profile_position_by_sdo(drive: BenchDrive) -> None:
    for place, value in (
        ("6060", 1),
        ("6065", 2000),
        ("607D:01", -(2**31)),
        ("607D:02", 2**31 - 1),
        ("607F", 25000),
        ("6081", 500),
        ("6083", 10000),
        ("6084", 10000),
        ("6085", 10000),
        ("6086", 0),
    ):
        assert drive.set(place, value) == 0, place
    drive.word(0x06, 0x0F)
    assert drive.set("607A", 3200) == 0
    drive.word(0x3F)
    drive.wait(1000)
    assert drive.get("6064") == 3200
    drive.word(0x0F)
    drive.set("607A", -3200)
    drive.word(0x7F)
    drive.wait(1000)
    assert drive.get("6064") == 0, "bit 6: relative"


def test_profile_velocity_by_sdo(drive: BenchDrive) -> None:
    for place, value in (("6060", 3), ("607F", 25000), ("6083", 10000), ("6084", 10000), ("6085", 10000)):
        assert drive.set(place, value) == 0, place
    drive.word(0x06, 0x0F)
    assert drive.set("60FF", 600) == 0
    drive.word(0x0F)
    drive.wait(500)
    assert (drive.get("606C"), drive.get("606B")) == (600, 600)
    before = drive.get("6064")
    drive.wait(1000)
    assert drive.get("6064") - before == pytest.approx(10 * 3200, abs=5)
    drive.word(0x10F)
    drive.wait(500)
    assert drive.get("606C") == 0


def test_homing_with_the_objects_of_application_notes(drive: BenchDrive) -> None:
    for place, value in (
        ("6060", 6),
        ("6065", 2000),
        ("6085", 10000),
        ("30B1", 0),
        ("6099:01", 100),
        ("6099:02", 10),
        ("609A", 1000),
        ("30B2", 500),
        ("30B0", 1200),
        ("6098", 7),
    ):
        assert drive.set(place, value) == 0, place
    assert drive.get("6098") == 7
    drive.set("6098", 33)
    drive.word(0x06, 0x0F, 0x1F)
    drive.wait(100)
    assert drive.get("6041") & 0x3400 == 0x1400
    assert drive.get("6064") == 1200
    assert drive.set("6098", -4) == 0x0609_0030


def test_cyclic_synchronous_position_without_sync(drive: BenchDrive) -> None:
    for place, value in (("6060", 8), ("60C2:01", 10), ("607D:01", -100_000), ("607D:02", 100_000)):
        assert drive.set(place, value) == 0, place
    drive.nmt(NmtCommand.START)
    drive.word(0x06, 0x0F)
    for i in range(1, 51):
        drive.send(0x410, (0x0F).to_bytes(2, "little") + (20 * i).to_bytes(4, "little"))
        drive.wait(10)
    assert drive.get("6041") & 0x1000
    drive.wait(2000)
    assert drive.get("6064") == 1000, "the last target is held"
    assert drive.errors() == []


def test_cyclic_synchronous_position_with_sync(drive: BenchDrive) -> None:
    assert drive.write_all(pdo(0x1402, 0x410, [("6040", 16), ("607A", 32)], 1)) == {}
    for place, value in (("6060", 8), ("60C2:01", 20)):
        assert drive.set(place, value) == 0, place
    drive.nmt(NmtCommand.START)
    drive.word(0x06, 0x0F)
    for i in range(1, 51):
        drive.send(0x410, (0x0F).to_bytes(2, "little") + (40 * i).to_bytes(4, "little"))
        drive.send(0x080, b"")
        drive.wait(20)
    drive.wait(100)
    assert drive.get("6064") == 2000
    assert drive.errors() == []


@pytest.mark.parametrize("low_first", [True, False])
def test_two_limits_of_0_are_none(drive: BenchDrive, low_first: bool) -> None:
    drive.set("6060", 1)
    drive.word(0x06, 0x0F)
    drive.set("607A", 100_000)
    drive.word(0x1F)
    drive.wait(4000)
    assert drive.get("6064") == 100_000
    drive.word(0x0F)
    limits = [("607D:01", -5000), ("607D:02", 5000)]
    for place, value in limits if low_first else reversed(limits):
        assert drive.set(place, value) == 0
    drive.set("607A", 0)
    drive.word(0x1F)
    drive.wait(4000)
    drive.word(0x0F)
    drive.set("607A", -9000)
    drive.word(0x1F)
    drive.wait(4000)
    assert drive.get("6064") == -5000
    assert drive.get("6041") & 0x0800


def test_the_masters_of_ros_1_find_their_mappings(drive: BenchDrive) -> None:
    """But for [30D3:01], an object of maxon's own that the package maps into TPDO3."""
    writes = [
        *pdo(0x1400, 0x210, [("6040", 16), ("60FF", 32)], 1),
        *pdo(0x1401, 0x310, [("607A", 32), ("6081", 32)], 1),
        *pdo(0x1402, 0x410, [("6083", 32), ("6084", 32)], 1),
        *pdo(0x1403, 0x510, [("6071", 16), ("6060", 8)], 1),
        *pdo(0x1800, 0x190, [("6041", 16), ("6061", 8)], 1),
        *pdo(0x1801, 0x290, [("606B", 32), ("606C", 32)], 1),
        *((at(place), value) for place, value in (("6065", 2000), ("30B1", 0), ("607F", 3000), ("6085", 10000))),
        *((at(place), value) for place, value in (("6099:01", 100), ("609A", 1000), ("30B2", 500), ("60C2:01", 10))),
    ]
    assert drive.write_all(writes) == {}


def test_objects_that_an_epos4_does_not_have_are_absent(drive: BenchDrive) -> None:
    entries = drive.firmware.nodes[0].dictionary.entries
    for index in (
        0x1006,
        0x1013,
        0x1015,
        0x1019,
        0x100C,
        0x2000,
        0x2012,
        0x605D,
        0x608F,
        0x6091,
        0x60C0,
        0x60C1,
        0x67FE,
    ):
        assert not any(address >> 8 == index for address in entries), f"{index:04X}"
