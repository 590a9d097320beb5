"""A host that commands the next motion within a few ms of a homing's end: the shadow neither delays it nor tells it."""

from collections.abc import Sequence
from struct import pack

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.shadow.axes import ComparedAxis, DriveReport
from steptwin.host.client.axis import AxisClient
from steptwin.host.robots import load_robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, Mode
from steptwin.protocol.frame import COB_RPDO, COB_SDO_REQUEST
from steptwin.protocol.pvt import PvtRecord
from tests.features.shadow.machines import Heard, Real, shadowed

ROBOT = load_robot("teaching-scara")
AXIS = 1
SEARCH_UNITS_PER_S = 1_638_400
RECORDS = 40
PEAK = 1600 * 64
"""Velocity of the PVT run in 1/64 unit per ms: the search's, 1562 steps/s."""
FAR_UNITS = -4_000_000
OBJECTS = (
    (od.MODE_OF_OPERATION, Mode.HOMING),
    (od.HOMING_METHOD, 17),
    (od.HOMING_SEARCH_SPEED, SEARCH_UNITS_PER_S),
    (od.HOMING_ZERO_SPEED, SEARCH_UNITS_PER_S // 10),
    (od.HOMING_ACCELERATION, 26_214_400),
    (od.HOME_OFFSET, -5_642_354),
    (od.TARGET_POSITION, FAR_UNITS),
    (od.PROFILE_VELOCITY, SEARCH_UNITS_PER_S),
    (od.PROFILE_ACCELERATION, 26_214_400),
    (od.PROFILE_DECELERATION, 26_214_400),
)


class HurriedHost:
    """A host that homes an axis and gives it the next motion as soon as it is told the end."""

    def __init__(self, kernel: Kernel, stand_at: Sequence[float] | None = None) -> None:
        self.real = Real(ROBOT, kernel, stand_at)
        self.network = self.real.board.network
        self.began = 0
        """Place of the frame that starts the homing among all frames."""
        self.begins_s = self.ends_s = 0.0
        """Instants of the homing's end and of the beginning of the next motion."""

    def run(self, mode: Mode) -> None:
        with self.real.session.charge("home", needs=()) as charge:
            axis = charge.enable().axes[AXIS]
            self._home(axis)
            self.ends_s = self.real.board.now_s()
            if mode is Mode.INTERPOLATED_POSITION:
                self._stream(axis)
            else:
                self._control(axis, Mode.PROFILE_POSITION, ENABLE_OPERATION)
                self._control(axis, Mode.PROFILE_POSITION, ENABLE_OPERATION | Control.START)
                self.begins_s = self.real.board.now_s()
            self.real.board.wait(1.5)

    def _home(self, axis: AxisClient) -> None:
        for address, value in OBJECTS:
            axis.write(address, value)
        self.began = len(self.real.board.bus_log)
        axis.write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
        self.real.board.wait(0.02)
        while axis.drive_status is None or axis.drive_status.homing:
            self.real.board.wait(0.0001)

    def _stream(self, axis: AxisClient) -> None:
        """Empty the queue, start with the first records, then send the others at once."""
        self._control(axis, Mode.INTERPOLATED_POSITION, ENABLE_OPERATION)
        clear = bytes.fromhex("2F C460 06 00000000")
        self.network.send_message(COB_SDO_REQUEST + axis.node_id, clear)
        before = 0
        for i in range(RECORDS):
            after = PEAK * min(i + 1, 8, RECORDS - 1 - i) // 8
            axis.send_record(PvtRecord((before + after) * 10 // 128, after, 10, i).encode())
            before = after
            if i == 3:
                self._control(axis, Mode.INTERPOLATED_POSITION, ENABLE_OPERATION | Control.START)
                self.begins_s = self.real.board.now_s()

    def _control(self, axis: AxisClient, mode: Mode, controlword: int) -> None:
        self.network.send_message(COB_RPDO[0] + axis.node_id, pack("<Hb", controlword, mode))


def late(host: HurriedHost, late_us: int) -> Heard:
    """Return what is heard if the stamp of the frame that starts the homing is so late: so is the twin's homing."""
    heard = host.real.heard()
    us, frame = heard[host.began]
    heard[host.began] = us + late_us, frame
    return heard


@pytest.fixture(scope="module", params=[Mode.INTERPOLATED_POSITION, Mode.PROFILE_POSITION], ids=["pvt", "profile"])
def hurried(request: pytest.FixtureRequest, fast_kernel: Kernel) -> HurriedHost:
    host = HurriedHost(fast_kernel)
    host.run(request.param)
    assert host.begins_s - host.ends_s < 0.0025
    return host


@pytest.mark.slow
@pytest.mark.parametrize("late_us", [0, 1400, 3000, 5000, 7000, 9500, 12000])
def test_the_next_motion_begins_when_it_is_commanded(hurried: HurriedHost, late_us: int, fast_kernel: Kernel) -> None:
    """Its frames came before the twin's search had ended; the twin executes them neither earlier nor later."""
    told, shadow = shadowed(ROBOT, late(hurried, late_us), fast_kernel)
    assert told == []
    assert shadow.caught_up_s == pytest.approx(late_us * 1e-6, abs=0.002)


@pytest.fixture(scope="module")
def streamed(fast_kernel: Kernel) -> HurriedHost:
    host = HurriedHost(fast_kernel)
    host.run(Mode.INTERPOLATED_POSITION)
    return host


@pytest.mark.slow
@pytest.mark.parametrize("later_ms", [0.5, 2.5, 8.5, 12.0])
def test_a_motion_by_ways_from_where_the_homing_ended(
    later_ms: float, streamed: HurriedHost, fast_kernel: Kernel
) -> None:
    """PVT records are ways: what a step more or less at the end of the homing makes is no fault at their end.

    The twin stood so much farther from or nearer to its switch, by the time of its search.
    """
    stand_at = list(ROBOT.home)
    stand_at[AXIS] -= later_ms / 1000 * SEARCH_UNITS_PER_S / float(ROBOT.wire_units_per_unit[AXIS])
    told, _ = shadowed(ROBOT, streamed.real.heard(), fast_kernel, stand_at)
    assert told == []


def test_the_twin_may_tell_the_beginning_of_the_next_homing_first() -> None:
    """It is not let ahead then: the end that the board has told is that of the homing before."""
    searches, found = DriveReport(0x0237, Mode.HOMING, 0), DriveReport(0x1637, Mode.HOMING, 0)
    axis = ComparedAxis(1.0)
    for counts, told in ((100, searches), (200, found)):
        axis.board.take(counts, told)
        axis.twin.take(counts, told)
    axis.twin.take(300, searches)
    assert not axis.waits_for_the_twin
    axis.board.take(301, searches)
    assert not axis.waits_for_the_twin
    axis.board.take(400, found)
    assert axis.waits_for_the_twin
