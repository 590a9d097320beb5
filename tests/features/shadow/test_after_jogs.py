"""Motions that follow a jog at once: what jitter has left where the jog ended is no fault on the way or at rest."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.shadow.axes import ComparedAxis, DriveReport, TwinAxis
from steptwin.features.shadow.discrepancy import DiscrepancyKind
from steptwin.host.operate.jogging import jog
from steptwin.host.operate.moving import move
from steptwin.host.robots import load_robot
from steptwin.protocol.cia402 import Mode, Status
from steptwin.protocol.frame import COB_TPDO
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.features.shadow.machines import NEAR, Real, homed, shadowed
from tests.features.shadow.test_shadow import changed, moved

ROBOT = load_robot("teaching-scara")
TH1_NODE = 0x10
BEGIN = [-113.0, -145.0, 3.0, -350.0]
"""Near the switches by which the axes are homed; th1 has way to both sides."""
PAUSES_S = (0.0, 0.06, 0.12, 0.2)
RAMP_S = 0.126
"""Time in which th1 reaches its highest speed."""


@pytest.fixture(scope="module")
def hurried(fast_kernel: Kernel) -> Real:
    """A machine whose th1 is jogged for less than its ramp takes, then moved or jogged again with hardly a pause."""
    real = homed(ROBOT, fast_kernel, NEAR)
    move(real.session, BEGIN)
    for i in range(17):
        speed = (1 - 2 * (i % 2)) * 0.97 * ROBOT.joints[0].speed_max
        jog(real.session, "th1", speed, 0.6 * RAMP_S + 0.0013 * i)
        real.board.wait(PAUSES_S[i % 4])
        if i % 3:
            goal = [(-101.0, -125.0)[i // 2 % 2], -145.0 + 5.0 * (i % 3), *BEGIN[2:]]
            move(real.session, goal, speed_percent=(100.0, 15.0)[i % 2])
    real.board.wait(0.6)
    return real


JITTERS = [(0, 0), (300, 0), *((1500, seed) for seed in range(3))]
"""Longest lateness of a stamp in us, and seed; without lateness nothing is drawn."""


@pytest.mark.slow
@pytest.mark.parametrize(("jitter_us", "seed"), JITTERS)
def test_no_false_alarm(hurried: Real, jitter_us: int, seed: int, fast_kernel: Kernel) -> None:
    told, _ = shadowed(ROBOT, hurried.heard(jitter_us=jitter_us, seed=seed), fast_kernel, NEAR)
    assert told == []


@pytest.mark.slow
@pytest.mark.parametrize("steps", [2, -2])
def test_a_step_too_many_at_the_end_is_told(hurried: Real, steps: int, fast_kernel: Kernel) -> None:
    """Also where the last jog was not seen at rest before the way to the target."""
    heard = hurried.heard()
    cob_id = COB_TPDO[0] + TH1_NODE
    last = sum(frame.cob_id == cob_id for _, frame in heard)
    told, _ = shadowed(ROBOT, changed(heard, cob_id, moved(steps * 1024), last - 3, last), fast_kernel, NEAR)
    assert [(each.axis, each.kind, each.error_steps) for each in told] == [("th1", DiscrepancyKind.REST, float(steps))]


@pytest.fixture(scope="module")
def stepped(fast_kernel: Kernel) -> Real:
    """A machine whose th1 makes relative moves right after jogs, and then an absolute one."""
    real = homed(ROBOT, fast_kernel, NEAR)
    move(real.session, BEGIN)
    for i in range(15):
        jog(real.session, "th1", (1 - 2 * (i % 2)) * 0.97 * ROBOT.joints[0].speed_max, 0.6 * RAMP_S + 0.0013 * i)
        real.board.wait(PAUSES_S[i % 4])
        for sign in (1, -1) if i % 3 else ():
            real.go_relative(real.session.machine.axes[0], sign * 60_000)
            real.board.wait(PAUSES_S[(i + 1) % 4])
    move(real.session, [-110.0, *BEGIN[1:]])
    real.board.wait(0.6)
    return real


@pytest.mark.slow
@pytest.mark.parametrize(("jitter_us", "seed"), JITTERS)
def test_no_false_alarm_by_relative_moves(stepped: Real, jitter_us: int, seed: int, fast_kernel: Kernel) -> None:
    """They keep what a jog has left, whether or not anybody has seen its rest; the target at the end does not."""
    told, _ = shadowed(ROBOT, stepped.heard(jitter_us=jitter_us, seed=seed), fast_kernel, NEAR)
    assert told == []


@pytest.mark.slow
@pytest.mark.parametrize("steps", [2, -2])
def test_a_step_too_many_after_the_absolute_move_is_told(stepped: Real, steps: int, fast_kernel: Kernel) -> None:
    heard = stepped.heard(jitter_us=300)
    cob_id = COB_TPDO[0] + TH1_NODE
    last = sum(frame.cob_id == cob_id for _, frame in heard)
    told, _ = shadowed(ROBOT, changed(heard, cob_id, moved(steps * 1024), last - 3, last), fast_kernel, NEAR)
    assert [(each.axis, each.kind, each.error_steps) for each in told] == [("th1", DiscrepancyKind.REST, float(steps))]


@pytest.fixture(scope="module")
def creeping(fast_kernel: Kernel) -> Real:
    """A machine whose th1 goes on so slowly after each jog that the ways to the target differ by more than 350 ms."""
    real = homed(ROBOT, fast_kernel, NEAR)
    move(real.session, BEGIN)
    for i in range(8):
        sign = 1 - 2 * (i % 2)
        jogged = jog(real.session, "th1", sign * 0.97 * ROBOT.joints[0].speed_max, 0.6 * RAMP_S + 0.0013 * i)
        move(real.session, [jogged.end + 1.5 * sign, *BEGIN[1:]], speed_percent=1)
    real.board.wait(0.6)
    return real


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_twin_misses_no_heartbeat_while_it_comes_to_rest(creeping: Real, seed: int, fast_kernel: Kernel) -> None:
    told, _ = shadowed(ROBOT, creeping.heard(jitter_us=1500, seed=seed), fast_kernel, NEAR)
    assert told == []


class Sides:
    """Both sides of an axis with a step of 1 unit, each told every 10 ms."""

    def __init__(self) -> None:
        self.axis = ComparedAxis(1.0)
        self._ms = 1000
        for _ in range(20):
            self.tell(Mode.PROFILE_POSITION, 0, 0, 0)

    def look(self, mode: Mode, twin: int, velocity: int) -> TwinAxis:
        self._ms += 10
        reached = 0 if velocity else Status.TARGET_REACHED
        for side in (self.axis.board, self.axis.twin):
            side.take(self.counts, DriveReport(0x0237 | reached, mode, twin))
        now = TwinAxis(twin, velocity, 0, RAMP_STEPS_PER_S2)
        self.axis.follow(self.counts, now)
        return now

    @property
    def counts(self) -> int:
        return self._ms * COUNTS_PER_MS

    def tell(self, mode: Mode, twin: int, velocity: int, error: int) -> int:
        """Return how many discrepancies there are if the board is so far ahead."""
        now = self.look(mode, twin, velocity)
        return len(list(self.axis.positions(self.counts, twin + error, now)))

    def jog(self, error: int, *, seen: bool = True) -> int:
        """Move at 1000 steps/s until a host ends it on the way, and rest apart for 200 ms, told or not."""
        self.look(Mode.PROFILE_VELOCITY, 0, 1000)
        self.axis.command(1000)
        self.look(Mode.PROFILE_VELOCITY, 50, 1000)
        for _ in range(20):
            if not seen:
                self.look(Mode.PROFILE_VELOCITY, 100, 0)
            elif self.tell(Mode.PROFILE_VELOCITY, 100, 0, error):
                return 1
        return 0

    def go(self, error: int) -> int:
        """Move on to a target at 100 steps/s; the difference on the way is told twice."""
        return self.tell(Mode.PROFILE_POSITION, 150, 100, error) + self.tell(Mode.PROFILE_POSITION, 151, 100, error)


RAMP_STEPS_PER_S2 = 10_000


@pytest.mark.parametrize(("error", "told"), [(40, 0), (-40, 0), (41, 1), (-41, 1)])
def test_how_far_apart_a_jog_may_end(error: int, told: int) -> None:
    """16 ms of 1000 steps/s up and down, and of the ramp's 10 000 steps/s2 in 16 and 20 ms; 2.25 ms of the speed."""
    assert Sides().jog(error) == told


@pytest.mark.parametrize(("error", "told"), [(-38, 0), (-16, 0), (0, 0), (2, 0), (3, 1), (-40, 0), (-41, 1)])
def test_a_way_to_a_target_makes_up_for_what_a_jog_has_left(error: int, told: int) -> None:
    """The difference goes from what it was at rest to none; 2 steps are jitter."""
    sides = Sides()
    assert sides.jog(-38) == 0
    assert sides.go(error) == told


@pytest.mark.parametrize(("error", "told"), [(42, 0), (-42, 0), (43, 1), (-43, 1)])
def test_the_next_motion_begins_where_nobody_has_seen_the_jog_end(error: int, told: int) -> None:
    """A board that moves on after 200 ms may not have told its position twice meanwhile: it is somewhere within."""
    sides = Sides()
    sides.jog(0, seen=False)
    assert sides.go(error) == told


def test_the_twin_may_come_to_rest_so_much_later() -> None:
    """It begins 38 steps farther from the target, and makes them, and a step of rounding, at 100 steps/s."""
    sides = Sides()
    sides.jog(-38)
    sides.go(-38)
    assert sides.axis.later_s == pytest.approx(0.39)
