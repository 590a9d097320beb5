"""Edges spooled piece by piece make the same file as edges written at once."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.host.record.folder import AxisTotals, EdgeSpool, read_edges
from steptwin.host.record.folder.edges import PINS, write_edges
from steptwin.host.verify import AxisEvidence, DriverViolations, Evidence, LevelEdges, Phases
from tests.host.record.folder.stored import EVIDENCE, assert_same


def piece_of(axis: AxisEvidence, from_counts: int, until_counts: int) -> AxisEvidence:
    """Return an axis' evidence in [from_counts, until_counts); a pulse belongs to the piece in which it begins."""

    def within(counts: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
        chosen = (counts >= from_counts) & (counts < until_counts)
        return [values[chosen] for values in (counts, *others)]

    rises, falls = within(axis.clk_rise_counts, axis.clk_fall_counts)
    turns, levels = within(axis.dir_edge_counts, axis.dir_levels)
    steps, signs = within(axis.step_counts, axis.step_signs)
    broken, which = within(axis.violations.counts, axis.violations.which)
    _, values = within(axis.violations.counts, axis.violations.values)
    violations = DriverViolations(axis.violations.limits, broken, which, values)
    changes, sixteenths = within(axis.phases.counts, axis.phases.sixteenths)
    currents_ma = [within(axis.phases.counts, values_ma)[1] for values_ma in (axis.phases.a_ma, axis.phases.b_ma)]
    phases = Phases(changes, sixteenths, *currents_ma)
    pins = {pin: LevelEdges(*within(axis.pins[pin].counts, axis.pins[pin].levels)) for pin in PINS}
    return replace(
        axis,
        clk_rise_counts=rises,
        clk_fall_counts=falls,
        dir_edge_counts=turns,
        dir_levels=levels,
        step_counts=steps,
        step_signs=signs,
        pins=pins,
        violations=violations,
        phases=phases,
    )


def spool(path: Path, evidence: Evidence, cuts: list[int]) -> None:
    end = 1 + max(int(axis.clk_fall_counts[-1]) for axis in evidence.axes if axis.clk_fall_counts.size)
    bounds = [0, *sorted(cuts), max([end, *cuts])]
    spool = EdgeSpool(path)
    for first, last in pairwise(bounds):
        for axis in evidence.axes:
            spool.append(piece_of(axis, first, last))
    totals = [
        AxisTotals(axis.name, axis.start_steps, axis.active_edge, axis.violations.limits) for axis in evidence.axes
    ]
    spool.finish(evidence.start_counts, totals)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.integers(0, 200_000_000), max_size=5))
def test_pieces_read_back_joined(tmp_path: Path, cuts: list[int]) -> None:
    spool(tmp_path / "edges.npz", EVIDENCE, cuts)
    assert_same(read_edges(tmp_path), EVIDENCE)
    assert [entry.name for entry in tmp_path.iterdir()] == ["edges.npz"]


def test_both_ways_to_write_give_the_same_arrays(tmp_path: Path) -> None:
    write_edges(tmp_path / "one.npz", EVIDENCE)
    spool(tmp_path / "two.npz", EVIDENCE, [])
    with np.load(tmp_path / "one.npz") as one, np.load(tmp_path / "two.npz") as two:
        assert sorted(one.files) == sorted(two.files)
        for key in one.files:
            assert one[key].dtype == two[key].dtype
            np.testing.assert_array_equal(one[key], two[key])


def test_equal_edges_make_equal_files(tmp_path: Path) -> None:
    for name in ("one.npz", "two.npz"):
        spool(tmp_path / name, EVIDENCE, [90_000_000])
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_a_killed_run_leaves_its_edges(tmp_path: Path) -> None:
    begun = EdgeSpool(tmp_path / "edges.npz")
    begun.append(EVIDENCE.axes[0])
    key = f"{EVIDENCE.axes[0].name}_clk_rise_counts"
    np.testing.assert_array_equal(
        np.fromfile(tmp_path / "edges.part" / key, dtype="<i8"), EVIDENCE.axes[0].clk_rise_counts
    )


def test_a_new_run_replaces_an_old_one_and_a_killed_one(tmp_path: Path) -> None:
    path = tmp_path / "edges.npz"
    write_edges(path, EVIDENCE)
    killed = EdgeSpool(path)
    killed.append(EVIDENCE.axes[0])
    assert not path.exists()
    spool(path, EVIDENCE, [])
    assert_same(read_edges(tmp_path), EVIDENCE)
