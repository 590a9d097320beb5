"""Faults of the wires between board and driver: levels at every instant, then what they do to a motion."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.axis_wires import AxisWires, Noise, Wire, WireState
from steptwin.emulator.drivers.driver_module import Module, fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.terminals import TerminalEdges
from steptwin.emulator.world.switches import Switch
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.drivers import PROFILES, ActiveEdge
from steptwin.protocol.frame import Frame
from tests.emulator.pins import CHIP
from tests.emulator.simulations import NODE, STEP, wait
from tests.features.faults.kinds.wires_rig import Rig
from tests.messages import refusing
from tests.one_example import one_example

END = 20_000
WHOLE, BROKEN, LOW, HIGH = WireState


class Turns(NamedTuple):
    """Turns of STEP and DIR, as sorted instants; an even number of STEP's."""

    step: list[int]
    dir: list[int]


def levels(turns: list[int]) -> np.ndarray:
    """The level at each instant."""
    return np.bincount(turns, minlength=END + 1)[: END + 1].cumsum() % 2


def pins(turns: Turns, from_counts: int, until_counts: int) -> TerminalEdges:
    """The pulses and turns that begin in a stretch of time."""
    pulses = list(zip(turns.step[0::2], turns.step[1::2], strict=True))
    own = [pulse for pulse in pulses if from_counts <= pulse[0] < until_counts]
    before = sum(turn < from_counts for turn in turns.dir)
    dir_turns = [turn for turn in turns.dir if from_counts <= turn < until_counts]
    return TerminalEdges(
        np.array([rise for rise, _ in own], np.int64),
        np.array([fall for _, fall in own], np.int64),
        np.array(dir_turns, np.int64),
        np.array([(before + 1 + i) % 2 for i in range(len(dir_turns))], np.int8),
        (),
        until_counts,
    )


INSTANTS = st.lists(st.integers(0, END - 1), unique=True, max_size=20).map(sorted)
TURNS = st.builds(Turns, INSTANTS.map(lambda found: found[: len(found) // 2 * 2]), INSTANTS)
NOISES = st.builds(
    Noise,
    rate_hz=st.sampled_from([20_000.0, 70_000.0]),
    width_ns=st.sampled_from([14, 900, 5_000]),
    count=st.sampled_from([None, 1, 3]),
    seed=st.integers(0, 5),
)


def passed(turns: Turns, noise: dict[Wire, Noise], cuts: list[int]) -> list[TerminalEdges]:
    """What a driver is told, stretch by stretch."""
    wires = AxisWires(ActiveEdge.RISING, enable_open=0, step_level=0, dir_level=0, enable_level=0)
    told = [wires.change(wire, condition, 0) for wire, condition in noise.items()]
    told += [wires.take(pins(turns, *stretch)) for stretch in pairwise([0, *cuts, END])]
    assert wires.lost_steps == signed(turns) - sum(
        2 * int(levels(dir_turns(told))[rise]) - 1 for each in told for rise in each.clk_rise_counts
    )
    return told


def signed(turns: Turns) -> int:
    return sum(2 * int(levels(turns.dir)[rise]) - 1 for rise in turns.step[0::2])


def dir_turns(told: list[TerminalEdges]) -> list[int]:
    return [turn for each in told for turn in each.dir_counts.tolist()]


@pytest.mark.slow
@given(turns=TURNS, step=NOISES, direction=st.none() | NOISES, cuts=INSTANTS)
def test_noise_turns_the_level_over_however_time_is_divided(
    turns: Turns, step: Noise, direction: Noise | None, cuts: list[int]
) -> None:
    noise = {Wire.STEP: step} | ({Wire.DIR: direction} if direction else {})
    told = passed(turns, noise, cuts)
    rises, falls = (np.concatenate([getattr(each, f"clk_{edge}_counts") for each in told]) for edge in ("rise", "fall"))
    flips = {wire: until_end(each) for wire, each in noise.items()}
    until = int(falls[-1]) if falls.size else 0  # a pulse is passed on when it ends
    seen, wanted = levels(sorted([*rises, *falls])), levels(turns.step) ^ levels(flips[Wire.STEP])
    assert (seen[:until] == wanted[:until]).all()
    assert wanted[until:].sum() == 0 or (np.diff(wanted[until:]) != 0).sum() <= 2
    if not any(levels(flips[Wire.STEP])[-1:]) and not turns.step:
        assert rises.size == len([flip for flip in flips[Wire.STEP] if flip < END]) // 2
    dirs = dir_turns(told)
    assert dirs == sorted(dirs)
    wanted = levels(turns.dir) ^ levels(flips.get(Wire.DIR, []))
    known = told[-1].until_counts
    assert (levels(dirs)[:known] == wanted[:known]).all()
    assert [each.dir_levels.tolist() for each in told] == [
        [int(levels(dirs)[turn]) for turn in each.dir_counts.tolist()] for each in told
    ]


def until_end(noise: Noise) -> list[int]:
    found = []
    for flip in noise.flips(0):
        if flip >= END:
            break
        found.append(flip)
    return found


@pytest.mark.parametrize(
    "changes",
    [
        {"rate_hz": 0},
        {"rate_hz": 1_000_001},
        {"width_ns": 0},
        {"width_ns": 10_000},
        {"count": 0},
    ],
)
def test_impossible_noise_is_refused(changes: dict[str, int]) -> None:
    values = {"rate_hz": 100_000, "width_ns": 9_900}
    Noise(**values)
    with refusing(ValueError):
        Noise(**values | changes)


@pytest.fixture
def rig(fast_kernel: Kernel) -> Rig:
    return Rig(fast_kernel)


@pytest.mark.parametrize("condition", [BROKEN, LOW])
def test_without_step_the_driver_counts_nothing_until_the_repair(rig: Rig, condition: WireState) -> None:
    rig.move()
    wait(rig.simulation, 40)
    broken = rig.wire(Wire.STEP, condition)
    wait(rig.simulation, 20)
    whole = rig.wire(Wire.STEP, WHOLE)
    wait(rig.simulation, 100)
    trace = rig.board.trace(0)
    lost = ((trace.step_counts < broken) | (trace.step_counts >= whole)).sum() == trace.step_counts.size
    assert lost
    counted, missing = rig.monitor
    assert counted == trace.clk_rise_counts.size == trace.position_steps
    assert counted + missing == 50
    assert 8 <= missing <= 18
    assert rig.board.firmware.motion.axes[0].demand_units == 50 * STEP
    assert not trace.violations.counts.size


@pytest.mark.parametrize(("edge", "at_once", "at_repair"), [(ActiveEdge.RISING, 1, 0), (ActiveEdge.FALLING, 0, -1)])
def test_step_held_high_is_one_pulse(fast_kernel: Kernel, edge: ActiveEdge, at_once: int, at_repair: int) -> None:
    """The driver steps with its rise or with its fall, to where DIR points then: up first, down after the move."""
    rig = Rig(fast_kernel, None if edge is ActiveEdge.RISING else Module(CHIP, active_edge=edge))
    rig.move(10)
    wait(rig.simulation, 150)
    high = rig.wire(Wire.STEP, HIGH)
    wait(rig.simulation, 50)
    rig.move(-10)
    wait(rig.simulation, 150)
    trace = rig.board.trace(0)
    now = rig.board.firmware.motion.tick * TICK_COUNTS
    assert (trace.clk_rise_counts[-1], trace.clk_fall_counts[-1]) == (high, now)
    assert rig.monitor == (10 + at_once, -10 - at_once)
    low = rig.wire(Wire.STEP, WHOLE)
    wait(rig.simulation, 50)
    trace = rig.board.trace(0)
    assert (trace.clk_rise_counts[-1], trace.clk_fall_counts[-1]) == (high, low)
    rig.move(-10)
    wait(rig.simulation, 150)
    trace = rig.board.trace(0)
    assert trace.clk_rise_counts.size == 21
    assert trace.position_steps == at_once + at_repair == rig.monitor[0]
    assert trace.violations.rules() == []


@pytest.mark.parametrize(("condition", "counted"), [(LOW, -50), (BROKEN, -50), (HIGH, 50)])
def test_dir_at_a_level_sends_every_step_one_way(rig: Rig, condition: WireState, counted: int) -> None:
    rig.wire(Wire.DIR, condition)
    rig.move()
    wait(rig.simulation, 150)
    rig.move(-50)
    wait(rig.simulation, 150)
    assert rig.monitor == (2 * counted, -2 * counted)
    rig.wire(Wire.DIR, WHOLE)
    rig.move()
    wait(rig.simulation, 150)
    assert rig.monitor == (2 * counted + 50, -2 * counted)
    assert not rig.board.trace(0).violations.counts.size


@pytest.mark.parametrize(
    ("driver", "condition", "on"),
    [
        ("chip-330pf", BROKEN, (0, 0)),
        ("3a-module", BROKEN, (1, 1)),
        ("3a-module", LOW, (0, 0)),
        ("chip-330pf", HIGH, (1, 1)),
    ],
)
def test_enable_decides_over_the_current_not_over_the_count(
    fast_kernel: Kernel, driver: str, condition: WireState, on: tuple[int, int]
) -> None:
    """The 3 A module is on without a cable: so the firmware cannot switch its current off then."""
    rig = Rig(fast_kernel, fitted(PROFILES[driver], 16) if driver != "chip-330pf" else None)
    rig.wire(Wire.ENABLE, condition)
    rig.move()
    wait(rig.simulation, 400)
    assert rig.monitor[0] == 50
    assert powered(rig) == on[0]
    rig.simulation.send(control(0x06))
    wait(rig.simulation, 10)
    assert powered(rig) == on[1]
    changes = [change.level for change in rig.board.pin_changes if change.pin is Pin.ENABLE]
    assert changes == [1, 0][: 2 - on[0]]
    rig.wire(Wire.ENABLE, WHOLE)
    wait(rig.simulation, 10)
    assert powered(rig) == 0
    assert rig.board.trace(0).violations.rules() == []


def control(word: int) -> Frame:
    return Frame(0x200 + NODE, bytes((word, 0, 7)))


def powered(rig: Rig) -> int:
    """Whether current flows in the motor."""
    now = np.array([rig.simulation.now_counts])
    return int(rig.board.trace(0).outputs.currents_a(now).any())


class TestNoise:
    def test_on_step_moves_a_standing_motor_to_its_switch(self, fast_kernel: Kernel) -> None:
        """The firmware sees the switch in time, and takes its own count for true."""
        rig = Rig(fast_kernel, switches=(Switch(0, DigitalInput.HOME, to_substeps=-20),))
        rig.wire(Wire.STEP, Noise(rate_hz=2_000, width_ns=50_000, count=25, seed=1))
        closed_after = 0
        for _ in range(40):
            wait(rig.simulation, 0.5)
            seen = DigitalInput(rig.board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS))
            assert bool(seen & DigitalInput.HOME) == (seen_steps(rig) <= -20)
            closed_after += bool(seen & DigitalInput.HOME)
        assert 0 < closed_after < 40
        assert rig.monitor == (-25, 25)
        assert not rig.board.moving
        assert rig.board.firmware.motion.axes[0].counter_steps == 0

    def test_on_step_too_short_for_the_chip_is_a_violation(self, rig: Rig) -> None:
        rig.wire(Wire.STEP, Noise(rate_hz=1_000, width_ns=29_000, count=7))
        wait(rig.simulation, 50)
        trace = rig.board.trace(0)
        assert (trace.position_steps, trace.violations.rules()) == (0, [Rule.CLK_HIGH] * 7)
        assert trace.clk_rise_counts.size == 7

    def test_on_dir_turns_the_steps_that_it_meets(self, rig: Rig) -> None:
        rig.wire(Wire.DIR, Noise(rate_hz=500, width_ns=1_000_000))
        rig.move()
        wait(rig.simulation, 150)
        counted, lost = rig.monitor
        assert 0 < lost == 50 - counted
        assert lost % 2 == 0

    def test_on_enable_interrupts_the_current(self, rig: Rig) -> None:
        before = len(rig.board.pin_changes)
        rig.wire(Wire.ENABLE, Noise(rate_hz=1_000, width_ns=100_000, count=3))
        wait(rig.simulation, 50)
        rig.board.drain()
        changes = rig.board.pin_changes[before:]
        assert [change.level for change in changes] == [0, 1] * 3
        assert {after.counts - before.counts for before, after in zip(changes[::2], changes[1::2], strict=True)} == {
            7_200
        }


def seen_steps(rig: Rig) -> int:
    """Steps that had been counted at the start of the tick in which the inputs were read last."""
    tick_counts = (rig.board.firmware.motion.tick - 1) * TICK_COUNTS
    trace = rig.board.trace(0)
    return int(trace.step_signs[trace.step_counts < tick_counts].sum())


@pytest.mark.parametrize("count", [None, 3])
def test_some_noise_turns_the_level_over(count: int | None) -> None:
    step, direction = Noise(70_000.0, 900, count, seed=1), Noise(20_000.0, 5_000, None, seed=2)
    turns = Turns([100, 2_500, 9_000, 9_001, 15_000, 18_000], [50, 7_000, 16_000])
    one_example(test_noise_turns_the_level_over_however_time_is_divided, turns, step, direction, [3_000, 9_001, 15_500])
