"""A shadow hears a machine in virtual time: no false alarm, and every harm is named within a second."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Operation
from steptwin.features.faults.kinds.machine import EmergencyStop, Slip, WatchdogReset
from steptwin.features.replay.power_up import MachineAtPowerUp
from steptwin.features.shadow.discrepancy import Discrepancy, DiscrepancyKind
from steptwin.features.shadow.shadow import Shadow
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.jogging import jog
from steptwin.host.operate.moving import move
from steptwin.host.record.recorded_bus import RecordedFrame
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.frame import COB_EMCY, COB_SDO_RESPONSE, COB_TPDO, Frame
from tests.features.shadow.machines import NEAR, Heard, Real, homed, shadowed

ROBOT = load_robot("teaching-scara")
AWAY = [-110.0, -105.0, 10.0, -330.0]
BACK = [-125.0, -125.0, 3.0, -350.0]
ELSEWHERE = ([-115.0, -120.0, 10.0, -345.0], [-125.0, -120.0, 15.0, -350.0])
TH2_NODE = 0x11


@pytest.fixture(scope="module")
def quiet(fast_kernel: Kernel) -> Real:
    """A machine that is homed and moved, with nothing amiss."""
    real = homed(ROBOT, fast_kernel, NEAR)
    move(real.session, AWAY)
    real.board.wait(0.5)
    real.rest_frames = len(real.board.bus_log)
    real.board.wait(0.5)
    move(real.session, BACK)
    real.board.wait(0.5)
    return real


@pytest.mark.slow
@pytest.mark.parametrize(("jitter_us", "ppm"), [(0, 0.0), (300, 100.0), (1500, 100.0), (1500, -100.0)])
def test_no_false_alarm(quiet: Real, jitter_us: int, ppm: float, fast_kernel: Kernel) -> None:
    """Whatever the computer's clock does within its tolerance."""
    told, shadow = shadowed(ROBOT, quiet.heard(jitter_us=jitter_us, ppm=ppm), fast_kernel, NEAR)
    assert told == []
    assert shadow.frames > 500


@pytest.mark.slow
@pytest.mark.parametrize("stand_at", ELSEWHERE)
def test_where_the_machine_stood_need_not_be_known(quiet: Real, stand_at: list[float], fast_kernel: Kernel) -> None:
    """Until it is homed: then the twin searches its switches for as long as it needs."""
    told, shadow = shadowed(ROBOT, quiet.heard(jitter_us=300), fast_kernel, stand_at)
    assert told == []
    assert shadow.caught_up_s > 0.5


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1 << 30), jitter_us=st.integers(0, 1800), ppm=st.floats(-100, 100))
def test_no_false_alarm_by_any_jitter(quiet: Real, seed: int, jitter_us: int, ppm: float, fast_kernel: Kernel) -> None:
    told, _ = shadowed(ROBOT, quiet.heard(jitter_us=jitter_us, ppm=ppm, seed=seed), fast_kernel, NEAR)
    assert told == []


@pytest.mark.slow
def test_positions_in_units_of_a_masters_choice(fast_kernel: Kernel) -> None:
    """Thousandths of a degree of the motor, by gear ratio and feed constant (6091h, 6092h)."""
    real = homed(ROBOT, fast_kernel, NEAR)
    axis = real.session.machine.axes[1]
    real.session.machine.disable()
    axis.write(od.FEED_UNITS, 360_000)
    real.session.machine.enable()
    begin = axis.read(od.POSITION_DEMAND)
    for address, value in ((od.MODE_OF_OPERATION, 1), (od.TARGET_POSITION, begin + 72_000), (od.CONTROLWORD, 0x1F)):
        axis.write(address, value)
    real.board.wait(3.0)
    assert axis.read(od.POSITION_DEMAND) == begin + 72_000
    told, shadow = shadowed(ROBOT, real.heard(jitter_us=300), fast_kernel, NEAR)
    assert (told, shadow.joined) == ([], True)


def test_it_waits_for_a_boot_up(quiet: Real, fast_kernel: Kernel) -> None:
    later = quiet.heard()[200:]
    told, shadow = shadowed(ROBOT, later, fast_kernel, NEAR)
    assert not shadow.joined
    assert told == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("operation", "kind", "says"),
    [
        (EmergencyStop(pressed=True), DiscrepancyKind.ERROR, "estop (0x9000)"),
        (WatchdogReset(), DiscrepancyKind.BOOT_UP, "boot-up"),
    ],
)
def test_what_the_board_does_without_a_cause_in_the_frames(
    operation: Operation, kind: DiscrepancyKind, says: str, fast_kernel: Kernel
) -> None:
    """Every axis is named within 1 s, and what the twin did instead."""
    real = homed(ROBOT, fast_kernel, NEAR)
    at_s = 1_764_000_000 + real.board.now_s()
    real.operate(operation)
    real.board.wait(1.5)
    told, _ = shadowed(ROBOT, real.heard(jitter_us=300), fast_kernel, NEAR)
    found = [each for each in told if each.kind is kind]
    assert [each.axis for each in found] == list(ROBOT.axis_names)
    assert all(says in each.board and each.twin == "nothing" for each in found)
    assert all(at_s - 0.01 <= each.at_s < at_s + 1.0 for each in told)


@pytest.mark.slow
def test_a_state_that_only_the_board_is_in(fast_kernel: Kernel) -> None:
    real = homed(ROBOT, fast_kernel, NEAR)
    real.operate(EmergencyStop(pressed=True))
    real.board.wait(1.0)
    told, _ = shadowed(ROBOT, real.heard(), fast_kernel, NEAR)
    states = [(each.axis, each.board, each.twin) for each in told if each.kind is DiscrepancyKind.STATE]
    assert states == [(name, "FAULT", "OPERATION ENABLED") for name in ROBOT.axis_names]


@pytest.mark.slow
@pytest.mark.parametrize("full_steps", [4, -4, 40])
def test_a_homing_tells_the_lost_steps(full_steps: int, fast_kernel: Kernel) -> None:
    """A rotor that has slipped by 4 full steps, a cycle, is 64 steps from where the board counts it."""
    real = homed(ROBOT, fast_kernel, NEAR)
    move(real.session, BACK)
    real.operate(Slip(1, full_steps))
    home_robot(real.session, joints=["th2"], stay=True)
    real.board.wait(0.6)
    told, _ = shadowed(ROBOT, real.heard(jitter_us=300), fast_kernel, NEAR)
    (found,) = told
    assert (found.axis, found.kind) == ("th2", DiscrepancyKind.HOMING)
    assert found.error_steps == pytest.approx(-16 * full_steps, abs=3)


def changed(heard: Heard, cob_id: int, change: Callable[[bytes], bytes], first: int, last: int) -> Heard:
    """Return the frames with another content in some of an identifier."""
    made, number = Heard(), 0
    for us, frame in heard:
        if frame.cob_id == cob_id:
            number += 1
            if first <= number <= last:
                frame = Frame(cob_id, change(frame.data))  # noqa: PLW2901
        made.append((us, frame))
    return made


def moved(units: int) -> Callable[[bytes], bytes]:
    """Return a change of a status PDO, whose last four bytes are the position."""

    def change(data: bytes) -> bytes:
        position = int.from_bytes(data[3:7], "little", signed=True) + units
        return data[:3] + position.to_bytes(4, "little", signed=True)

    return change


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "found"), [(0, False), (1, False), (2, True), (-2, True)])
def test_a_position_at_rest(quiet: Real, steps: int, found: bool, fast_kernel: Kernel) -> None:
    """One step may be the next tick's; two are told, once, and within a second."""
    heard = quiet.heard()
    last = sum(frame.cob_id == COB_TPDO[0] + TH2_NODE for _, frame in heard)
    real = changed(heard, COB_TPDO[0] + TH2_NODE, moved(steps * 1024), last - 5, last)
    told, _ = shadowed(ROBOT, real, fast_kernel, NEAR)
    assert [(each.axis, each.kind, each.error_steps) for each in told] == (
        [("th2", DiscrepancyKind.REST, float(steps))] if found else []
    )


@pytest.mark.slow
def test_an_answer_of_its_own(quiet: Real, fast_kernel: Kernel) -> None:
    """An abort in place of an answer is one discrepancy; the dialogue goes on."""
    heard = quiet.heard()
    abort = bytes((0x80, *od.MODE_OF_OPERATION.to_bytes(3, "little")[1:], 0, 0, 0, 0, 8))[:8]
    told, _ = shadowed(ROBOT, changed(heard, COB_SDO_RESPONSE + TH2_NODE, lambda _: abort, 20, 20), fast_kernel, NEAR)
    (answer,) = told
    assert (answer.axis, answer.kind) == ("th2", DiscrepancyKind.ANSWER)


@pytest.mark.slow
def test_an_error_of_its_own(quiet: Real, fast_kernel: Kernel) -> None:
    heard = quiet.heard()
    at_us = heard[1000][0]
    emergency = (at_us, Frame(COB_EMCY + TH2_NODE, bytes.fromhex("1042 01 0000000000")))
    told, _ = shadowed(ROBOT, [*heard[:1000], emergency, *heard[1000:]], fast_kernel, NEAR)
    (error,) = told
    assert (error.axis, error.kind, error.twin) == ("th2", DiscrepancyKind.ERROR, "nothing")


@pytest.mark.slow
def test_an_answer_that_is_missing(quiet: Real, fast_kernel: Kernel) -> None:
    """The board says less than its twin."""
    heard = quiet.heard()
    us = [us for us, frame in heard if frame.cob_id == COB_SDO_RESPONSE + TH2_NODE][-1]
    lost = [(at_us, frame) for at_us, frame in heard if (at_us, frame.cob_id) != (us, COB_SDO_RESPONSE + TH2_NODE)]
    told, _ = shadowed(ROBOT, lost, fast_kernel, NEAR)
    assert [(each.axis, each.kind, each.board) for each in told] == [("th2", DiscrepancyKind.ANSWER, "nothing")]


@pytest.mark.slow
def test_it_goes_on_from_a_recording(quiet: Real, fast_kernel: Kernel) -> None:
    """The recording may have ended hours ago by another clock, if the machine has stood still since."""
    heard = quiet.heard()
    told: list[Discrepancy] = []
    stands = MachineAtPowerUp(MachineOptions(stand_at=NEAR))
    shadow = Shadow(ROBOT, stands, told.append, fast_kernel)
    shadow.take_recording(RecordedFrame(us - heard[0][0], frame, False) for us, frame in heard[: quiet.rest_frames])
    assert shadow.joined
    for us, frame in heard[quiet.rest_frames :]:
        shadow.hear(us + 7_000_000_000, frame)
    assert told == []


@pytest.mark.slow
def test_frames_of_other_nodes_do_not_matter(quiet: Real, fast_kernel: Kernel) -> None:
    strange = [(us, Frame(0x1C0, b"\x01\x02")) for us, _ in quiet.heard()[100::50]]
    told, _ = shadowed(ROBOT, sorted([*quiet.heard(), *strange], key=lambda each: each[0]), fast_kernel, NEAR)
    assert told == []


@pytest.fixture(scope="module")
def jogged(fast_kernel: Kernel) -> Real:
    """A machine whose axes are jogged for times that differ by parts of a profile's segment."""
    real = homed(ROBOT, fast_kernel, NEAR)
    for i in range(6):
        jog(real.session, "d3", (1 - 2 * (i % 2)) * 0.9 * ROBOT.joints[2].speed_max, 0.25 + 0.0017 * i)
        real.board.wait(0.02 * (i % 3) if i < 4 else 0.4)
    return real


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_jog_may_end_a_segment_earlier_or_later(jogged: Real, seed: int, fast_kernel: Kernel) -> None:
    """The ramp to rest waits for the end of the segment in execution, which is another one if the stamp is late."""
    told, _ = shadowed(ROBOT, jogged.heard(jitter_us=1500, seed=seed), fast_kernel, NEAR)
    assert told == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "found"),
    [(0.8, False), (1.2, True), (-1.2, True)],
)
def test_a_jog_that_ends_elsewhere(jogged: Real, part: float, found: bool, fast_kernel: Kernel) -> None:
    """Its speed rises and falls once, each change within a segment of 16 ms; 2.25 ms are jitter."""
    units_per_s = 0.9 * ROBOT.joints[2].speed_max * float(ROBOT.wire_units_per_unit[2])
    units = round(units_per_s * (2 * 0.016 + 0.00225) * part)
    heard = jogged.heard()
    cob_id = COB_TPDO[0] + TH2_NODE + 1
    last = sum(frame.cob_id == cob_id for _, frame in heard)
    told, _ = shadowed(ROBOT, changed(heard, cob_id, moved(units), last - 3, last), fast_kernel, NEAR)
    assert {each.axis for each in told} == ({"d3"} if found else set())
