"""A driver whose history is taken in pieces: the pieces together are the whole history, and memory stays bounded."""

from dataclasses import replace
from random import Random
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import Module, fitted
from steptwin.emulator.drivers.outputs import ChipOutputs
from steptwin.emulator.drivers.terminals import LevelChange, Rail
from steptwin.protocol.drivers import Cooling, Coupler, Fact
from steptwin.protocol.drivers.tb6560 import SLOW_BLUE_BOARD, THREE_AMP_MODULE, tb6560
from tests.emulator.pins import CHIP, POWER_UP, TERMINALS, WIRES, at, cut, pins
from tests.emulator.simulations import MS
from tests.one_example import one_example

END = 2_000_000
CRUMB = Cooling(resistance_k_per_w=300, capacity_j_per_k=1e-5)
"""Cooling with which the chip is too hot within some ms."""
MODULES = [
    WIRES,
    Module(CHIP, cooling=CRUMB),
    fitted(SLOW_BLUE_BOARD, 16),
    fitted(replace(THREE_AMP_MODULE, idle_ms=Fact(2, "made for a test")), 8),
    Module(CHIP, clk=Coupler(9_000, 60_000), direction=Coupler(5_000, 2_000), enable=Coupler(70_000, 100)),
]

PULSES = st.lists(st.tuples(st.integers(1, 60_000), st.integers(1, 12_000)), min_size=1, max_size=30)
TURNS = st.lists(st.integers(0, END // 2), max_size=20, unique=True)
CHANGES = st.lists(
    st.builds(LevelChange, st.integers(1, END // 2), st.sampled_from(list(TERMINALS)), st.integers(0, 1)), max_size=10
)
CUTS = st.lists(st.integers(0, END), max_size=8)


class History(NamedTuple):
    """What a driver tells, times first: steps, violations, and the outputs from each instant on."""

    steps: NDArray[np.int64]
    violations: NDArray[np.int64]
    outputs: NDArray[np.float64]

    def outputs_at(self, times: NDArray[np.int64]) -> NDArray[np.float64]:
        return self.outputs[np.searchsorted(self.outputs[:, 0], times, side="right") - 1, 1:]


def told(driver: Driver) -> History:
    found = driver.violations
    return History(
        np.column_stack(driver.steps),
        np.column_stack((found.counts, found.which, found.values)),
        sampled(driver.chip.outputs),
    )


def sampled(outputs: ChipOutputs) -> NDArray[np.float64]:
    counts = outputs.instants()
    return np.column_stack(
        (counts, outputs.field_substeps(counts), outputs.home_levels(counts), outputs.currents_a(counts))
    )


def together(pieces: list[History]) -> History:
    return History(*(np.concatenate(parts) for parts in zip(*pieces, strict=True)))


@pytest.mark.slow
@given(pulses=PULSES, turns=TURNS, changes=CHANGES, cuts=CUTS)
@example(pulses=[(1, 1)], turns=[72002], changes=[LevelChange(1, Rail.VM, 0)], cuts=[72002, 72003])
def test_the_pieces_are_the_whole(
    pulses: list[tuple[int, int]], turns: list[int], changes: list[LevelChange], cuts: list[int]
) -> None:
    for module in MODULES:
        are_the_whole(module, pulses, turns, changes, cuts)


def are_the_whole(
    module: Module, pulses: list[tuple[int, int]], turns: list[int], changes: list[LevelChange], cuts: list[int]
) -> None:
    gaps, widths = zip(*pulses, strict=True)
    rises = np.cumsum(np.array(gaps) + np.concatenate(([0], widths[:-1]))).tolist()
    directions = [(counts, (i + 1) % 2) for i, counts in enumerate(sorted(turns))]
    in_order = sorted(changes, key=lambda change: change.counts)
    whole = pins(rises, widths, directions, (*POWER_UP, *in_order), until=2 * END)
    once, forgetful = Driver(replace(module, chip=tb6560(100))), Driver(replace(module, chip=tb6560(100)))
    once.feed(whole)
    pieces = []
    for piece in cut(whole, cuts):
        forgetful.feed(piece)
        pieces.append(told(forgetful))
        forgetful.forget()
    expected, history = told(once), together(pieces)
    assert history.steps.tolist() == expected.steps.tolist()
    assert sorted(history.violations.tolist()) == sorted(expected.violations.tolist())
    for instants in (history.violations[:, 0], history.outputs[:, 0]):
        assert (np.diff(instants) >= 0).all()
    times = np.linspace(0, 2 * END, 500).astype(np.int64)
    assert np.array_equal(history.outputs_at(times), expected.outputs_at(times))
    assert (forgetful.chip.position_steps, forgetful.lost_steps, forgetful.violation_count) == (
        once.chip.position_steps,
        once.lost_steps,
        once.violation_count,
    )


@pytest.mark.parametrize("module", MODULES)
def test_nothing_stays_in_memory(module: Module) -> None:
    """However often RESET, ENABLE and CLK change."""
    driver = Driver(module)
    driver.feed(pins(changes=POWER_UP, until=1))
    sizes = []
    for i in range(60):
        begin = (2 * i + 1) * MS
        changes = (*at(begin, RESET=0, ENABLE=0), *at(begin + 9, RESET=1, ENABLE=1))
        rises = [begin + 10_000 + 9000 * k for k in range(12)]
        driver.feed(pins(rises, 2160, changes=changes, until=begin + 2 * MS))
        driver.forget()
        sizes.append(size_of(driver))
    assert max(sizes[30:]) <= max(sizes[:30])


def size_of(thing: object, depth: int = 5) -> int:
    """Return the number of items in an object's lists and arrays, and in those of all its parts."""
    if isinstance(thing, np.ndarray):
        return thing.size
    if isinstance(thing, (list, tuple)):
        return len(thing) + sum(size_of(item, depth) for item in thing)
    return sum(size_of(part, depth - 1) for part in vars(thing).values()) if depth and hasattr(thing, "__dict__") else 0


def test_what_was_told_ahead_is_not_told_again() -> None:
    """The outputs come on 3 us after ENABLE, which is known with ENABLE."""
    driver = Driver(WIRES)
    pieces = []
    for piece in cut(pins(changes=POWER_UP, until=500), [1, 2]):
        driver.feed(piece)
        pieces.append(told(driver))
        driver.forget()
    assert pieces[0].outputs[:, 0].tolist() == [0, 216]
    assert (np.diff(together(pieces).outputs[:, 0]) > 0).all()


def test_a_change_that_comes_after_pulses_of_its_tick_is_told_with_the_next_piece() -> None:
    """The firmware has computed the tick already in which a frame makes it disable the driver."""
    driver = Driver(WIRES)
    driver.feed(pins([1000, 11_000], changes=POWER_UP, until=18_000))
    first = told(driver)
    driver.forget()
    driver.feed(pins(changes=at(12_000, ENABLE=0), until=36_000))
    second = told(driver)
    assert first.outputs[-1, 0] == 11_000
    assert second.outputs[:, 0].tolist() == [18_000]
    assert second.outputs[0, 3:].tolist() == [0, 0]
    assert first.outputs[-1, 1] == second.outputs[0, 1]


def test_the_pieces_of_one_stream_are_the_whole() -> None:
    draw = Random(1)
    pulses = [(draw.randint(1, 60_000), draw.randint(1, 12_000)) for _ in range(30)]
    changes = [
        LevelChange(draw.randint(1, END // 2), draw.choice(list(TERMINALS)), draw.randint(0, 1)) for _ in range(3)
    ]
    cuts = [draw.randint(0, END) for _ in range(8)]
    one_example(test_the_pieces_are_the_whole, pulses, draw.sample(range(END // 2), 20), changes, cuts)
