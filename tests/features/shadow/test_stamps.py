"""Clocks of stamps that are set, put back and restarted, while the twin's time goes on evenly."""

from collections.abc import Mapping

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.replay.power_up import MachineAtPowerUp
from steptwin.features.shadow.discrepancy import Discrepancy, DiscrepancyKind
from steptwin.features.shadow.shadow import ClockStep, Shadow
from steptwin.features.shadow.stamps import StampClock
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.moving import move
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.machine_options import MachineOptions
from tests.features.shadow.machines import COUNTS_PER_S, Heard, Real

ROBOT = load_robot("teaching-scara")
HOUR_US = 3_600_000_000
DAY_US = 24 * HOUR_US


def times(stamps: list[int], arrivals: list[int | None]) -> tuple[list[int], list[int]]:
    """Return the times and the steps that a clock makes of stamps."""
    clock = StampClock()
    heard = [(clock.hear(us, at, moving=False), clock.step_us) for us, at in zip(stamps, arrivals, strict=True)]
    return [us for us, _ in heard], [step for _, step in heard if step]


@pytest.mark.parametrize("step_us", [-50_000, -HOUR_US, -400 * DAY_US, 30_000, 500_000, HOUR_US, 400 * DAY_US])
def test_a_step_between_frames_that_come_as_they_are_stamped(step_us: int) -> None:
    arrivals = list(range(0, 4_000_000, 10_000))
    stamps = [7_000_000 + at + (step_us if at >= 2_000_000 else 0) for at in arrivals]
    made, steps = times(stamps, list(arrivals))
    assert steps == [step_us]
    assert made == [7_000_000 + at for at in arrivals]


@pytest.mark.parametrize(("step_us", "follows_us"), [(-HOUR_US, 10_000), (HOUR_US, 10_000), (900_000, 910_000)])
def test_a_step_that_stamps_alone_tell(step_us: int, follows_us: int) -> None:
    """Less than a second forward may be a silence."""
    made, steps = times([0, 10_000, 20_000 + step_us, 30_000 + step_us], [None] * 4)
    assert made == [0, 10_000, 10_000 + follows_us, 20_000 + follows_us]
    assert len(steps) == (follows_us == 10_000)


def test_late_frames_and_silence_are_no_steps() -> None:
    """A frame may come late, also a burst of them; so may one after a silence that its stamp tells."""
    stamps = [*range(0, 2_000_000, 10_000), 7_000_000, 7_010_000, 12_000_000, 12_010_000]
    arrivals: list[int | None] = [*range(0, 2_000_000, 10_000), 12_000_000, 12_000_100, 12_000_200, 12_010_000]
    assert times(stamps, arrivals) == (stamps, [])


def test_a_clock_that_is_corrected_slowly_does_not_step() -> None:
    arrivals = list(range(0, 60_000_000, 100_000))
    for ppm in (-400, 400):
        stamps = [round(at * (1 + ppm * 1e-6)) for at in arrivals]
        assert times(stamps, list(arrivals)) == (stamps, [])


@pytest.fixture(scope="module")
def estopped(fast_kernel: Kernel) -> tuple[Heard, float]:
    """Return the frames of a machine that is homed, moved, and stopped by its button, and when that was."""
    real = Real(ROBOT, fast_kernel)
    home_robot(real.session)
    move(real.session, [20.0, 30.0, 10.0, 40.0])
    real.board.wait(0.6)
    at_s = real.board.now_s()
    real.operate(EmergencyStop(pressed=True))
    real.board.wait(0.5)
    return real.heard(jitter_us=300), at_s


def shadowed(
    heard: Heard, steps_us: Mapping[int, int], kernel: Kernel
) -> tuple[list[Discrepancy], list[ClockStep], Shadow]:
    """Let a shadow hear frames whose clock steps at these frames."""
    told: list[Discrepancy] = []
    steps: list[ClockStep] = []
    power_up = MachineAtPowerUp(MachineOptions(stand_at=list(ROBOT.home)))
    shadow = Shadow(ROBOT, power_up, told.append, kernel, tell_step=steps.append)
    shift_us = 0
    for number, (us, frame) in enumerate(heard):
        shift_us += steps_us.get(number, 0)
        shadow.hear(us + shift_us, frame)
    return told, steps, shadow


@pytest.mark.slow
@pytest.mark.parametrize(
    "steps_us",
    [
        {1200: -HOUR_US},
        {1200: HOUR_US},
        {1100: DAY_US, 1101: -DAY_US, 1300: -30 * DAY_US},
        {600: -1_000_000, 700: 3_000_000, 1250: HOUR_US},
    ],
)
def test_the_twin_goes_on(estopped: tuple[Heard, float], steps_us: Mapping[int, int], fast_kernel: Kernel) -> None:
    """Nothing but the harm is told, at its time by the clock as it is then; no step is lived through."""
    heard, at_s = estopped
    told, steps, shadow = shadowed(heard, steps_us, fast_kernel)
    assert [step.step_s for step in steps] == pytest.approx([us / 1e6 for us in steps_us.values()], abs=0.2)
    assert [(each.kind, each.axis) for each in told] == [
        (kind, axis) for kind in (DiscrepancyKind.ERROR, DiscrepancyKind.STATE) for axis in ROBOT.axis_names
    ]
    shifted_s = 1_764_000_000 + at_s + sum(steps_us.values()) / 1e6
    assert all(shifted_s - 0.01 < each.at_s < shifted_s + 0.4 for each in told)
    lasted_s = (heard[-1][0] - heard[0][0]) / 1e6
    assert lasted_s - 1.0 < shadow.machine.simulation.now_counts / COUNTS_PER_S < lasted_s + 1.5
