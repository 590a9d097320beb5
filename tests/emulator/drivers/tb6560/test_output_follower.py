"""What a chip's follower tells, look by look, is what its outputs are in the end."""

import numpy as np
import pytest

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import Int8Array, Int64Array
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.output_follower import FieldTurns, OutputChanges
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.protocol.drivers import Cooling
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.emulator.pins import TERMINALS, a_tb6560

ON = (Rail.VDD, Rail.VM, Pin.RESET, Pin.ENABLE)
SETTINGS = (Pin.M1, Pin.M2, Pin.TQ1, Pin.TQ2, Pin.DCY1, Pin.DCY2)
CHANGING = (*SETTINGS, Pin.ENABLE, Pin.RESET)


def pins(
    rises: Int64Array, turns: tuple[Int64Array, Int8Array], changes: list[LevelChange], until_counts: int
) -> TerminalEdges:
    return TerminalEdges(rises, rises + 2400, *turns, tuple(changes), until_counts)


def in_full(found: FieldTurns | OutputChanges) -> OutputChanges:
    if isinstance(found, OutputChanges):
        return found
    counts, substeps, steady = found
    return OutputChanges(
        counts, substeps, steady.currents_a[steady.states(substeps)], np.full(counts.size, steady.fast)
    )


def followed(chip: DriverChip, seed: int, cycles: int = 40) -> list[OutputChanges]:
    """Let a chip live through some ms with pulses, turns and changes of its inputs; look after each stretch of it."""
    random, follower = np.random.default_rng(seed), chip.follow_outputs()
    levels, now_counts, told = dict.fromkeys(TERMINALS, 0), 0, []
    for cycle in range(cycles):
        until_counts = now_counts + int(random.integers(1, 4)) * 18_000
        changes = [LevelChange(now_counts, pin, 1) for pin in ON] if cycle == 0 else []
        if cycle and random.random() < 0.3:
            for number in random.choice(len(CHANGING), 2, replace=False).tolist():
                pin = CHANGING[number]
                changes.append(LevelChange(int(random.integers(now_counts, until_counts)), pin, 1 - levels[pin]))
        changes.sort(key=lambda change: change.counts)
        levels |= {change.terminal: change.level for change in changes}
        rises = np.arange(now_counts + 100, until_counts - 4000, int(random.integers(4800, 9000)), dtype=np.int64)
        at = np.sort(random.integers(now_counts, until_counts, 2))
        chip.feed(pins(rises, (at, np.array([1, 0], dtype=np.int8)), changes, until_counts))
        if cycle % 7 == 6:
            chip.forget()  # what a live board does is nothing to the follower
        now_counts = until_counts
        if (found := follower.look(now_counts)) is not None:
            told.append(in_full(found))
    return told


@pytest.mark.parametrize("seed", range(6))
def test_it_tells_what_the_outputs_are(seed: int) -> None:
    told = followed(a_tb6560(100.0), seed)
    counts = np.concatenate([each.counts for each in told])
    assert (np.diff(counts) >= 0).all()
    whole = a_tb6560(100.0)
    _ = followed_without_forgetting(whole, seed)
    outputs = whole.outputs
    last = np.searchsorted(counts, counts, side="right") - 1
    for name, known in (("substeps", outputs.field_substeps(counts)), ("fast", outputs.fast_decay(counts))):
        values = np.concatenate([getattr(each, name) for each in told])[last]
        np.testing.assert_array_equal(values % 64 if name == "substeps" else values, known)
    currents_a = np.concatenate([each.currents_a for each in told])[last]
    np.testing.assert_allclose(currents_a, np.round(outputs.currents_a(counts), 3), atol=1e-12)
    assert set(outputs.instants().tolist()) <= set(counts.tolist())
    angles = np.concatenate([each.substeps for each in told])
    assert np.abs(np.diff(angles)).max() <= 32


def followed_without_forgetting(chip: DriverChip, seed: int) -> list[OutputChanges]:
    """Let a chip live through the same, and remember all of it."""
    chip.forget = lambda: None  # type: ignore[method-assign]
    return followed(chip, seed)


def test_a_thermal_shutdown_is_told_at_its_instant() -> None:
    """A chip that is nearly too hot switches its outputs off without an edge at any pin."""
    chip = a_tb6560(100.0, cooling=Cooling(resistance_k_per_w=200.0, capacity_j_per_k=1e-4))
    follower, nothing = chip.follow_outputs(), np.empty(0, dtype=np.int64)
    none = nothing, np.empty(0, dtype=np.int8)
    chip.feed(pins(nothing, none, [LevelChange(0, pin, 1) for pin in (*ON, *SETTINGS[:2])], COUNTS_PER_MS))
    told = []
    for ms in range(1, 40):
        chip.feed(pins(nothing, none, [], ms * COUNTS_PER_MS))
        told.append(follower.look(ms * COUNTS_PER_MS))
    off_counts = int(chip.violations.counts.max())
    changes = [in_full(each) for each in told if each is not None]
    assert changes[-1].counts.tolist() == [off_counts]
    assert not changes[-1].currents_a.any()
    assert changes[0].currents_a[-1].any()
