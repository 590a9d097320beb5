"""A replay against the arrays of the run's folder: joints, pins, edges, windows and marks at any instant."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.features.view import model
from steptwin.features.view.marks import MarkKind
from steptwin.features.view.model import POINTS_MAX, Edge, Replay, Span
from steptwin.host.cli.app import run
from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder.edges_file import PINS
from steptwin.host.record.waveforms import pins
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND
from tests.messages import refusing

SOME_PINS = ("step", "dir", "enable", "m1")
JOINTS = ("th1", "th2", "d3", "th4")
RNG = np.random.default_rng(14)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the shortest job, with three violations added that its drivers have not seen."""
    path = tmp_path_factory.mktemp("carry")
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        assert run(["run", "teaching-scara", "carry", "--out", str(path)]) == 0
    with np.load(path / "edges.npz") as stored:
        changed = dict(stored)
    changed["th2_violation_counts"] = changed["th2_clk_rise_counts"][[100, 101, 2000]]
    changed["th2_violation_which"] = np.array([0, 0, 1], np.int8)
    changed["th2_violation_values"] = np.array([1.0, 2.0, 3.0])
    np.savez(path / "edges.npz", **changed)
    return path


@pytest.fixture(scope="module")
def replay(folder: Path) -> Replay:
    return Replay.of_folder(folder)


@pytest.fixture(scope="module")
def arrays(folder: Path) -> dict[str, Any]:
    with np.load(folder / "edges.npz") as stored:
        return dict(stored)


@pytest.fixture(scope="module")
def instants(arrays: dict[str, Any]) -> Int64Array:
    """Instants everywhere, and at, just before and just after edges."""
    rises = np.concatenate([arrays[f"{joint}_clk_rise_counts"] for joint in JOINTS])
    edges = RNG.choice(rises, 8)
    return np.concatenate([RNG.integers(0, rises.max() + COUNTS_PER_MS, 8), edges, edges - 1, edges + 1])


def every_edge(arrays: dict[str, Any]) -> Iterator[Edge]:
    """Every change of every pin, from the file's arrays alone."""
    for joint in JOINTS:
        for counts in arrays[f"{joint}_clk_rise_counts"].tolist():
            yield Edge(counts, joint, "step", 1)
        for counts in arrays[f"{joint}_clk_fall_counts"].tolist():
            yield Edge(counts, joint, "step", 0)
        for pin, counts_key, levels_key in [
            ("dir", "dir_edge_counts", "dir_levels"),
            *((pin, f"{pin}_counts", f"{pin}_levels") for pin in PINS),
        ]:
            pairs = zip(arrays[f"{joint}_{counts_key}"].tolist(), arrays[f"{joint}_{levels_key}"].tolist(), strict=True)
            for counts, level in pairs:
                yield Edge(counts, joint, pin, level)


def test_joints_and_counts(replay: Replay, arrays: dict[str, Any], instants: Int64Array) -> None:
    robot = replay.run.robot
    for counts in instants.tolist():
        shown = replay.at(counts)
        t_s = replay.time_s(counts)
        assert t_s == (counts - arrays["start_counts"]) / COUNTS_PER_SECOND
        planned = replay.run.comparison.expected.motion.positions(np.clip([t_s], 0.0, 1.0))[0]
        for row, joint, at in zip(shown.joints, robot.joints, planned, strict=True):
            before = np.searchsorted(arrays[f"{row.name}_step_counts"], counts, side="right")
            steps = arrays[f"{row.name}_start_steps"] + arrays[f"{row.name}_step_signs"][:before].sum()
            assert (row.name, row.unit, row.steps, row.planned) == (joint.name, joint.unit, steps, at)
            assert row.counted == steps / joint.transmission.steps_per_unit
            assert row.error_steps == pytest.approx(steps - at * joint.transmission.steps_per_unit)
        tool_mm = np.array([shown.planned_pose[:3], shown.counted_pose[:3]])
        assert shown.tool_error_mm == pytest.approx(np.linalg.norm(tool_mm[1] - tool_mm[0]))


@pytest.mark.slow
def test_levels_currents_and_the_edges_around(replay: Replay, arrays: dict[str, Any], instants: Int64Array) -> None:
    edges = sorted(every_edge(arrays), key=lambda edge: edge.counts)
    all_counts = [edge.counts for edge in edges]
    signals = {(each.axis, each.quantity): each for each in pins(replay.run.comparison.evidence)}
    assert {pin for axis, pin in signals if axis == JOINTS[0]} == {"step", "dir", *PINS}
    own = {(joint, pin): [e for e in edges if (e.axis, e.pin) == (joint, pin)] for joint in JOINTS for pin in SOME_PINS}
    for counts in instants.tolist():
        shown, now = replay.at(counts), Span(counts, counts)
        for (joint, pin), changes in own.items():
            made = [edge.level for edge in changes if edge.counts <= counts]
            assert model.lane(signals[joint, pin], now).values[0] == (made[-1] if made else 0)
        for joint in JOINTS:
            set_at = np.searchsorted(arrays[f"{joint}_phase_counts"], counts, side="right") - 1
            expected = [int(arrays[f"{joint}_phase_{each}_ma"][set_at]) if set_at >= 0 else 0 for each in "ab"]
            assert [current.values[0] for current in replay.currents(now, joint)] == expected
        before, after = bisect_left(all_counts, counts), bisect_right(all_counts, counts)
        assert (shown.before and shown.before.counts) == (all_counts[before - 1] if before else None)
        assert (shown.after and shown.after.counts) == (all_counts[after] if after < len(edges) else None)
        assert {shown.before, shown.after} - {None} <= set(edges)


def test_stepping_visits_every_edge_of_an_axis_once(replay: Replay, arrays: dict[str, Any]) -> None:
    edges = [edge for edge in every_edge(arrays) if edge.axis == "d3"]
    forwards, counts = [], -1
    while edge := replay.edge_after(counts, "d3"):
        counts = edge.counts
        forwards.append(counts)
    assert forwards == sorted({edge.counts for edge in edges})
    backwards, counts = [], counts + 1
    while edge := replay.edge_before(counts, "d3"):
        counts = edge.counts
        backwards.append(counts)
    assert backwards == forwards[::-1]


def test_a_window_holds_every_change(replay: Replay, arrays: dict[str, Any]) -> None:
    middle = replay.counts_at(0.5)
    span = Span(middle - 2 * COUNTS_PER_MS, middle + 2 * COUNTS_PER_MS)
    lanes = {(lane.axis, lane.quantity): lane for lane in replay.lanes(span)}
    assert list(lanes) == [(joint, pin) for joint in JOINTS for pin in ("step", "dir")]
    inside = [edge for edge in every_edge(arrays) if span.from_counts < edge.counts <= span.to_counts]
    for (joint, pin), lane in lanes.items():
        expected = sorted((e.counts, e.level) for e in inside if (e.axis, e.pin) == (joint, pin))
        assert list(zip(lane.counts[1:].tolist(), lane.values[1:].tolist(), strict=True)) == expected
        assert lane.counts[0] == span.from_counts
        assert not lane.crowded
    assert [lane.axis for lane in replay.lanes(span, ["th2"])] == ["th2", "th2"]
    for lane, phase in zip(replay.currents(span, "th2"), "ab", strict=True):
        key = arrays["th2_phase_counts"]
        within = (key > span.from_counts) & (key <= span.to_counts)
        assert set(lane.counts[1:].tolist()) <= set(key[within].tolist())
        assert lane.values[-1] == arrays[f"th2_phase_{phase}_ma"][within][-1]


def test_a_crowded_window_says_how_many_changes_it_has(replay: Replay, arrays: dict[str, Any]) -> None:
    lanes = {(lane.axis, lane.quantity): lane for lane in replay.lanes(replay.record)}
    step = lanes["th2", "step"]
    assert step.changes == 2 * arrays["th2_clk_rise_counts"].size > POINTS_MAX
    assert step.crowded
    assert step.counts.tolist() == [0]
    assert not lanes["th2", "enable"].crowded


def test_marks(replay: Replay, arrays: dict[str, Any]) -> None:
    marks = replay.marks
    assert list(marks) == sorted(marks, key=lambda mark: mark.counts)
    broken = [mark for mark in marks if mark.kind is MarkKind.VIOLATION]
    first, last, alone = arrays["th2_violation_counts"].tolist()
    assert [(mark.who, mark.counts, mark.until_counts) for mark in broken] == [
        ("th2", first, last),
        ("th2", alone, alone),
    ]
    states = [mark for mark in marks if mark.kind is MarkKind.STATE]
    enabled = next(mark for mark in states if mark.text == "enabled")
    assert enabled.counts < replay.start_counts
    assert set(enabled.who.split(", ")) == set(JOINTS)
    assert not [mark for mark in marks if mark.kind is MarkKind.ERROR]


def test_the_shown_span_is_the_motion_and_a_second_before_it(replay: Replay, arrays: dict[str, Any]) -> None:
    assert replay.shown.from_counts == max(0, arrays["start_counts"] - COUNTS_PER_SECOND)
    last = max(edge.counts for edge in every_edge(arrays))
    assert replay.shown.to_counts == replay.record.to_counts == max(last, arrays["start_counts"] + COUNTS_PER_SECOND)
    assert replay.counts_at(-1e6) == 0
    assert replay.counts_at(1e6) == replay.record.to_counts
    assert replay.counts_at(0.25) == arrays["start_counts"] + COUNTS_PER_SECOND // 4


def test_other_folders_are_refused(tmp_path: Path, folder: Path) -> None:
    with refusing(InputError):
        Replay.of_folder(tmp_path / "none")
    for path in folder.iterdir():
        if path.name != "bus.log":
            (tmp_path / path.name).symlink_to(path)
    with refusing(InputError):
        Replay.of_folder(tmp_path)
