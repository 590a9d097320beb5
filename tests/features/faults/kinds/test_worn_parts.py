"""Switches that bounce, broken wires of switches, drivers in another mode, other capacitors: on boards in motion."""

from itertools import pairwise

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.inputs import Bouncer
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.world.switches import Switch
from steptwin.features.faults.kinds.wiring import (
    BouncingSwitch,
    Contact,
    DriverMode,
    OscCapacitor,
    StuckSwitch,
    SwitchWire,
)
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.drivers.tb6560 import THREE_AMP_MODULE
from tests.compiled import skip_if_compiled
from tests.emulator.simulations import MS, wait
from tests.features.faults.kinds.wires_rig import Rig
from tests.messages import refusing

HOME, LIMIT = DigitalInput.HOME, DigitalInput.POSITIVE_LIMIT
AT_20 = (Switch(0, HOME, from_substeps=20),)


def seen(rig: Rig) -> DigitalInput:
    return DigitalInput(rig.board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS))


def changes_of(rig: Rig, ms: float) -> list[tuple[int, bool]]:
    """Let time pass; return each change of the home switch that the firmware sees, with the tick's instant."""
    skip_if_compiled()
    told: list[tuple[int, bool]] = []
    tell = rig.board.firmware.set_inputs

    def set_inputs(levels: list[DigitalInput], now_counts: int) -> None:
        told.append((now_counts, bool(levels[0] & HOME)))
        tell(levels, now_counts)

    rig.board.firmware.set_inputs = set_inputs  # type: ignore[assignment, method-assign]
    wait(rig.simulation, ms)
    rig.board.firmware.set_inputs = tell  # type: ignore[method-assign]
    return told


class TestBounces:
    def test_end_at_the_new_level_within_their_time(self) -> None:
        for closed in (True, False):
            bouncer = Bouncer(4, 5_000, 1, closed=not closed)
            shown = [closed ^ bouncer.inverted(tick, closed=closed) for tick in range(100, 140)]
            assert shown[0] == closed
            assert shown[20:] == [closed] * 20
            assert 2 <= sum(before != after for before, after in pairwise(shown)) <= 8
            assert bouncer.next_tick(120) is None

    def test_are_looked_at_where_they_may_change(self) -> None:
        bouncer = Bouncer(4, 5_000, 1, closed=False)
        every = [bouncer.inverted(tick, closed=True) for tick in range(100, 122)]
        other, tick, found = Bouncer(4, 5_000, 1, closed=False), 100, {}
        while True:
            found[tick] = other.inverted(tick, closed=True)
            following = other.next_tick(tick)
            if following is None:
                break
            tick = following
        held = [found[max(seen for seen in found if seen <= tick)] for tick in range(100, 122)]
        assert held == every

    def test_reach_the_firmware_and_cease(self, fast_kernel: Kernel) -> None:
        told = []
        for bounces in (0, 6):
            rig = Rig(fast_kernel, switches=AT_20)
            rig.simulation.operate(BouncingSwitch(0, HOME, bounces, 20_000, seed=2))
            rig.move()
            told.append(changes_of(rig, 150))
            assert not rig.board.moving
            assert seen(rig) & HOME
            rig.simulation.operate(BouncingSwitch(0, HOME, 0))
            rig.move(-50)
            assert [level for _, level in changes_of(rig, 150)] == [False]
        plain, bouncing = told
        assert [level for _, level in plain] == [True]
        assert bouncing[0] == plain[0]
        assert [level for _, level in bouncing] == [i % 2 == 0 for i in range(len(bouncing))]
        assert 3 <= len(bouncing) <= 13
        assert bouncing[-1][0] - bouncing[0][0] <= 20 * MS + TICK_COUNTS

    def test_may_end_while_the_contact_bounces(self, fast_kernel: Kernel) -> None:
        """Nobody looks at the instants any more at which it would have fallen back."""
        rig = Rig(fast_kernel, switches=AT_20)
        rig.simulation.operate(BouncingSwitch(0, HOME, 6, 20_000, seed=2))
        rig.move()
        for _ in range(100):
            wait(rig.simulation, 1)
            if seen(rig) & HOME:
                break
        rig.simulation.operate(BouncingSwitch(0, HOME, 0))
        assert [level for _, level in changes_of(rig, 100) if not level] == []
        assert seen(rig) & HOME
        assert not rig.board.moving

    @pytest.mark.parametrize(("bounces", "within_us"), [(-1, 5_000), (1001, 5_000), (3, 5), (0, 0)])
    def test_impossible_ones_are_refused(self, bounces: int, within_us: int) -> None:
        BouncingSwitch(0, HOME, 1000, 2000)
        with refusing(ValueError):
            BouncingSwitch(0, HOME, bounces, within_us)


@pytest.mark.parametrize(("contact", "levels"), [(Contact.NORMALLY_OPEN, [0, 0]), (Contact.NORMALLY_CLOSED, [1, 1])])
def test_a_broken_wire_shows_the_contact_at_rest_or_pressed(
    fast_kernel: Kernel, contact: Contact, levels: list[int]
) -> None:
    """A switch that sticks behind the broken wire sticks when it is mended."""
    rig = Rig(fast_kernel, switches=AT_20)
    rig.simulation.operate(SwitchWire(0, HOME, contact))
    wait(rig.simulation, 1)
    found = [bool(seen(rig) & HOME)]
    rig.move()
    wait(rig.simulation, 150)
    assert [*found, bool(seen(rig) & HOME)] == levels
    rig.simulation.operate(StuckSwitch(0, HOME, closed=False))
    rig.simulation.operate(SwitchWire(0, HOME, None))
    wait(rig.simulation, 1)
    assert not seen(rig) & HOME
    rig.simulation.operate(StuckSwitch(0, HOME, closed=None))
    wait(rig.simulation, 1)
    assert seen(rig) & HOME


class TestMode:
    @pytest.mark.parametrize("module", [False, True])
    def test_decides_how_long_a_step_is_until_it_is_as_before(self, fast_kernel: Kernel, module: bool) -> None:
        """Sixteenth steps become half steps in the middle of a motion; the driver is in reset for none of it."""
        rig = Rig(fast_kernel, fitted(THREE_AMP_MODULE, 16) if module else None)
        rig.move()
        wait(rig.simulation, 50)
        before = rig.board.position_steps(0)
        rig.simulation.operate(DriverMode(0, 2))
        wait(rig.simulation, 100)
        assert rig.board.driver_microsteps(0) == 2
        assert rig.monitor == (50, 0)
        moved = rig.board.position_full_steps(0) - before / 16
        assert 16 * moved == pytest.approx(8 * (50 - before), abs=16)  # the field jumps to a half step
        assert set(rig.board.trace(0).violations.rules()) == {Rule.MODE_CHANGE}
        levels = [change.level for change in rig.board.pin_changes if change.pin is Pin.M2]
        assert levels == ([1] if module else [1, 0])
        rig.simulation.operate(DriverMode(0, None))
        wait(rig.simulation, 1)
        stood = rig.board.position_full_steps(0)
        rig.move(20)
        wait(rig.simulation, 150)
        assert rig.board.driver_microsteps(0) == 16
        assert rig.board.position_full_steps(0) - stood == 20 / 16

    def test_a_switch_is_reached_by_the_longer_steps(self, fast_kernel: Kernel) -> None:
        rig = Rig(fast_kernel, switches=(Switch(0, HOME, from_substeps=200),))
        rig.simulation.operate(DriverMode(0, 1))
        rig.move()
        assert [level for _, level in changes_of(rig, 150)] == [True]

    def test_one_that_no_chip_has_is_refused(self) -> None:
        with refusing(ValueError):
            DriverMode(0, 3)


class TestCapacitor:
    @pytest.mark.parametrize(("osc_pf", "missed"), [(100, 0), (353, 0), (354, 50), (1000, 50)])
    def test_decides_which_pulses_count(self, fast_kernel: Kernel, osc_pf: float, missed: int) -> None:
        """Pulses are 33 us long: 4 periods of the oscillator at 353 pF."""
        rig = Rig(fast_kernel)
        rig.move()
        wait(rig.simulation, 150)
        rig.simulation.operate(OscCapacitor(0, osc_pf))
        rig.move()
        wait(rig.simulation, 150)
        trace = rig.board.trace(0)
        assert trace.position_steps == 100 - missed
        assert trace.violations.rules() == [Rule.CLK_HIGH] * missed
        limits = {trace.violations.limits[which].value for which in trace.violations.which.tolist()}
        assert all(limit > 33 * 72 for limit in limits)
        rig.simulation.operate(OscCapacitor(0, 330))
        rig.move()
        wait(rig.simulation, 150)
        assert rig.board.trace(0).position_steps == 150 - missed
        assert np.array_equal(rig.board.trace(0).violations.counts, trace.violations.counts)

    def test_one_outside_the_chips_range_is_refused(self, fast_kernel: Kernel) -> None:
        with refusing(ValueError):
            Rig(fast_kernel).simulation.operate(OscCapacitor(0, 60))
