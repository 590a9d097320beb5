"""What a view of a run holds: all that moves, and what it moves among, but no long rail."""

from dataclasses import replace

import numpy as np

from steptwin.features.view.model import Replay
from tests.host.record.machines import perfect_run


def test_a_view_holds_what_moves_but_no_long_rail() -> None:
    run = perfect_run("warehouse-scara", "store")
    shown = Replay(run, [])
    low_mm, high_mm = shown.extent_mm.min(axis=0), shown.extent_mm.max(axis=0)
    parts = shown.machine.links(np.linspace(0.0, run.duration_s, 50))
    rail = next(part for part in parts if part.name == "rail sx").points_mm
    assert rail.max() == 2000.0 > high_mm[0] > 1175.0 - 1e-6  # the shelf is shown because one of its drawers moves
    assert low_mm[1] <= -234.0
    for part in parts:
        if part.role != "guide":
            points_mm = part.points_mm.reshape(-1, 3)
            assert (points_mm >= low_mm - 1.0).all()
            assert (points_mm <= high_mm + 1.0).all()


def test_a_mechanism_that_its_counts_pull_apart_leaves_a_view_of_the_rest() -> None:
    """The hybrid arm's sliders cannot be further apart than its links allow; lost steps can count them so far."""
    run = perfect_run("hybrid-arm", "five-points")
    counted = list(run.comparison.counted)
    z5 = counted[1]
    counted[1] = replace(z5, positions=z5.positions + np.where(np.arange(len(z5.positions)) > 5000, 2e5, 0.0))
    shown = Replay(replace(run, comparison=replace(run.comparison, counted=tuple(counted))), [])
    parts = shown.machine.links(np.linspace(0.0, run.duration_s, 50))
    assert np.isnan(parts[-1].points_mm).any()
    assert np.isfinite(shown.extent_mm).all()
