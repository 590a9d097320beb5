"""Masters for Nanotec's CL3-E run unmodified on the personality nanotec-cl3."""

from math import pi

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol.cia402 import State
from steptwin.protocol.nmt import NmtCommand
from tests.features.personalities.bench_drive import BenchDrive, Write, at, pdo

REVOLUTION = 3_276_800
MILLIRADIAN = REVOLUTION * 204.4 / (2000 * pi)
"""Wire units of the master's own unit of positions: milliradians behind a gear of 2044:10."""

ROS2: list[Write] = [
    (at("1016:01"), 100 << 16 | 300),
    *pdo(0x1400, 0x210, [("6040", 16), ("6060", 8), ("6071", 16)], None),
    *pdo(0x1401, 0x310, [("607A", 32), ("60FF", 32)], None),
    *pdo(0x1800, 0x190, [("6041", 16), ("6061", 8), ("6077", 16)], 1),
    *pdo(0x1801, 0x290, [("6064", 32), ("606C", 32)], 1),
    (at("2030"), 50),
    (at("2031"), 1000),
    (at("203B:01"), 1000),
    (at("203B:02"), 100),
    (at("6072"), 1000),
    (at("6073"), 1000),
    (at("3202"), 0x41),
    (at("3212:04"), 1),
    (at("321A:01"), 1),
    (at("321A:02"), 1),
    (at("321A:03"), 1),
    (at("321A:04"), 1),
    (at("6083"), 2000),
    (at("6084"), 2000),
    (at("60A8"), 0xFD10_0000),
    (at("60A9"), 0xFD10_0300),
    (at("6091:01"), 2044),
    (at("6091:02"), 10),
]
"""The 47 writes of a ROS 2 configuration, in lely's order; values that only tune the current are made up."""


@pytest.fixture
def drive(fast_kernel: Kernel) -> BenchDrive:
    return BenchDrive(fast_kernel, "nanotec-cl3")


def command(drive: BenchDrive, word: int, mode: int) -> None:
    """RPDO1, which acts at once, then a SYNC."""
    drive.send(0x210, word.to_bytes(2, "little") + bytes((mode, 0, 0)))
    drive.send(0x080, b"")
    drive.wait(20)


def test_the_ros_2_configuration_is_accepted_and_moves_at_its_speed(drive: BenchDrive) -> None:
    assert len(ROS2) == 47
    assert drive.write_all(ROS2) == {}
    drive.nmt(NmtCommand.START)
    for word in (0x06, 0x07, 0x0F):
        command(drive, word, 1)
    assert drive.state() is State.OPERATION_ENABLED
    drive.send(0x310, (1000).to_bytes(4, "little") + bytes(4))
    command(drive, 0x3F, 1)
    top = drive.top_speed(4000)
    assert top == pytest.approx(500 * MILLIRADIAN, rel=1e-3), "6081 = 500, in milliradians per second now"
    command(drive, 0x2F, 1)
    position = drive.last(0x290)[:4]
    assert int.from_bytes(position, "little") == pytest.approx(1000, abs=1)
    assert drive.last(0x190)[1] & 0x04
    demand = drive.firmware.motion.axes[0].demand_units
    assert demand == pytest.approx(1000 * MILLIRADIAN, abs=1)


def test_profile_position_in_tenths_of_a_degree_and_rpm(drive: BenchDrive) -> None:
    for place, value in (("6060", 1), ("6081", 60), ("6083", 600), ("6084", 600)):
        assert drive.set(place, value) == 0
    assert drive.get("607A") == 4000
    drive.word(0x06, 0x07, 0x0F)
    drive.wait(500)
    assert drive.get("6064") == 0, "the target of 4000 at power-up moves nothing"
    drive.set("607A", 36_00)
    drive.word(0x1F)
    top = drive.top_speed(2000)
    assert top == pytest.approx(REVOLUTION, rel=1e-3), "60 rpm"
    assert (drive.get("6064"), drive.get("6062")) == (3600, 3600)


def test_profile_velocity(drive: BenchDrive) -> None:
    drive.set("6060", 3)
    drive.word(0x06, 0x07, 0x0F)
    drive.set("60FF", -300)
    drive.wait(1000)
    assert drive.get("606C") == -300
    drive.word(0x10F)
    drive.wait(1000)
    assert drive.get("606C") == 0


def test_homing_here(drive: BenchDrive) -> None:
    for place, value in (("6060", 6), ("6098", 35), ("607C", 900)):
        assert drive.set(place, value) == 0
    drive.word(0x06, 0x07, 0x0F, 0x1F)
    drive.wait(100)
    assert drive.get("6041") & 0x3400 == 0x1400
    assert drive.get("6064") == 900


def test_cyclic_synchronous_position(drive: BenchDrive) -> None:
    """Targets by the default RPDO2, which acts at once; SYNC comes for the TPDOs alone."""
    for place, value in (("6060", 8), ("60C2:01", 5)):
        assert drive.set(place, value) == 0
    drive.nmt(NmtCommand.START)
    drive.word(0x06, 0x07, 0x0F)
    for i in range(1, 101):
        drive.send(0x310, (9 * i).to_bytes(4, "little") + (500).to_bytes(4, "little"))
        drive.wait(1)
        drive.send(0x080, b"")
        drive.wait(4)
    drive.wait(100)
    assert drive.get("6064") == 900
    assert drive.errors() == []


def test_linear_interpolation_has_its_set_point_at_60c1(drive: BenchDrive) -> None:
    assert drive.write_all(pdo(0x1400, 0x210, [("6040", 16), ("60C1:01", 32)], 1)) == {}
    for place, value in (("6060", 7), ("60C2:01", 10)):
        assert drive.set(place, value) == 0
    drive.nmt(NmtCommand.START)
    drive.word(0x06, 0x07, 0x0F)
    for i in range(1, 51):
        drive.send(0x210, b"\x1f\0" + (18 * i).to_bytes(4, "little"))
        drive.send(0x080, b"")
        drive.wait(10)
    assert drive.get("6041") & 0x1000
    drive.wait(50)
    assert drive.get("6064") == 900
    assert drive.errors() == []


def test_a_number_stays_when_its_unit_changes(drive: BenchDrive) -> None:
    drive.set("6081", 60)
    assert drive.set("60A9", 0x0041_0300) == 0, "degrees per second"
    assert drive.get("6081") == 60
    drive.set("6060", 1)
    drive.word(0x06, 0x07, 0x0F)
    drive.set("607A", 600)
    drive.word(0x1F)
    assert drive.top_speed(500) == pytest.approx(60 / 360 * REVOLUTION, rel=1e-3)


def test_a_unit_cannot_change_while_the_drive_is_enabled_and_must_be_one(drive: BenchDrive) -> None:
    assert drive.set("60A8", 0x0001_0000) == 0x0609_0030, "metres, without a known feed"
    assert drive.set("6091:02", 0) == 0x0609_0032
    drive.word(0x06, 0x07, 0x0F)
    assert drive.set("60A9", 0x0041_0300) == 0x0800_0022
    assert drive.get("60A9") == 0x00B4_4700


def test_a_reset_of_the_node_brings_the_units_and_numbers_of_power_up(drive: BenchDrive) -> None:
    drive.write_all(ROS2)
    drive.nmt(NmtCommand.RESET_NODE)
    drive.wait(1)
    assert [drive.get(place) for place in ("60A8", "60A9", "6091:01", "6081", "6083")] == [
        0xFF41_0000,
        0x00B4_4700,
        1,
        500,
        500,
    ]
    drive.set("6060", 1)
    drive.word(0x06, 0x07, 0x0F)
    drive.set("607A", 3600)
    drive.word(0x1F)
    drive.wait(2000)
    assert drive.firmware.motion.axes[0].demand_units == REVOLUTION
