"""A recording: its pieces make the file that edges written at once make, and whatever ends it can be read."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.host.common import whole_file
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import append
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.folder import (
    AxisTotals,
    Header,
    Mark,
    Piece,
    PlanRows,
    Recording,
    read_edges,
    read_evidence,
    read_recording,
    read_report,
)
from steptwin.host.record.folder import recording as recording_module
from steptwin.host.record.folder.edges_file import PINS, evidence_until, write_edges
from steptwin.host.verify import AxisEvidence, DriverViolations, Evidence, LevelEdges, Phases
from steptwin.protocol.frame import Frame
from tests.host.record.folder.stored import EVIDENCE, FINE, assert_same
from tests.messages import refusing


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
    changes, substeps = within(axis.phases.counts, axis.phases.substeps)
    a_ma, b_ma = (within(axis.phases.counts, values_ma)[1] for values_ma in (axis.phases.a_ma, axis.phases.b_ma))
    phases = Phases(changes, substeps, a_ma, b_ma, axis.phases.per_full_step)
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


CUTS = [10_000_000, 20_000_000, 30_000_000]
TEXT = "t,a,b,v_a,v_b\n0.0,1.0,2.0,0.0,0.0\n"


def totals(evidence: Evidence) -> tuple[AxisTotals, ...]:
    return tuple(map(AxisTotals.of, evidence.axes))


def begin(folder: Path, evidence: Evidence = EVIDENCE) -> Recording:
    folder.mkdir(exist_ok=True)
    return Recording(folder, Header("a-robot", "chip-330pf", 500_000, totals(evidence)), "name = 'a-robot'")


def pieces(evidence: Evidence, cuts: list[int]) -> Iterator[Piece]:
    """Yield the evidence between the cuts, each piece with a frame and the first with a plan."""
    end = 1 + max(int(axis.clk_fall_counts[-1]) for axis in evidence.axes if axis.clk_fall_counts.size)
    bounds = [0, *sorted(cuts), max([end, *cuts])]
    for number, (first, last) in enumerate(pairwise(bounds)):
        axes = [piece_of(axis, first, last) for axis in evidence.axes]
        plans = [] if number else [PlanRows(1, TEXT.splitlines(keepends=True))]
        mark = Mark(until_counts=last, start_counts=evidence.start_counts, no_plan=None, wall_s=last / 72e6)
        yield Piece(axes, [log_line(first, Frame(0x080, b""))], plans, mark, 1)


def record(folder: Path, evidence: Evidence, cuts: list[int]) -> Recording:
    recording = begin(folder, evidence)
    for piece in pieces(evidence, cuts):
        recording.append(piece)
    return recording


@pytest.mark.slow
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.integers(0, 200_000_000), max_size=5))
def test_pieces_read_back_joined(tmp_path: Path, cuts: list[int]) -> None:
    record(tmp_path, EVIDENCE, cuts).finish({})
    assert_same(read_edges(tmp_path), EVIDENCE)
    files = {"report.json", "robot.toml", "trajectory.csv", "edges.npz", "bus.log"}
    assert {entry.name for entry in tmp_path.iterdir()} == files
    assert (tmp_path / "trajectory.csv").read_text() == TEXT


@pytest.mark.parametrize("evidence", [EVIDENCE, FINE], ids=["sixteenths", "fine"])
def test_both_ways_to_write_give_the_same_arrays(evidence: Evidence, tmp_path: Path) -> None:
    write_edges(tmp_path / "one.npz", evidence)
    record(tmp_path, evidence, [90_000_000]).finish({})
    with np.load(tmp_path / "one.npz") as one, np.load(tmp_path / "edges.npz") as two:
        assert sorted(one.files) == sorted(two.files)
        for key in one.files:
            assert one[key].dtype == two[key].dtype
            np.testing.assert_array_equal(one[key], two[key])


def test_equal_edges_make_equal_files(tmp_path: Path) -> None:
    for name in ("one", "two"):
        record(tmp_path / name, EVIDENCE, [90_000_000]).finish({})
    assert (tmp_path / "one" / "edges.npz").read_bytes() == (tmp_path / "two" / "edges.npz").read_bytes()


def test_a_recording_takes_the_place_of_an_older_one(tmp_path: Path) -> None:
    record(tmp_path, EVIDENCE, CUTS).finish({})
    record(tmp_path, EVIDENCE, [])
    begin(tmp_path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["bus.log", "recording.part", "robot.toml"]
    recording = read_recording(tmp_path)
    assert recording
    assert recording.mark == Mark()
    assert not recording.evidence().axes[0].step_counts.size


class TestInterrupted:
    """The reader sees everything up to the last mark, and nothing after it."""

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        record(tmp_path, EVIDENCE, CUTS)
        return tmp_path / "recording.part"

    def test_without_its_end_a_recording_reads_the_same(self, folder: Path) -> None:
        recording = read_recording(folder.parent)
        assert recording
        assert_same(recording.evidence(), EVIDENCE)
        assert recording.plan_text() == TEXT
        run = read_report(folder.parent).run
        assert (run.robot, run.job, run.bus.frames, run.bus.bitrate) == ("a-robot", "live", 4, 500_000)
        assert run.simulated_s == run.duration_s == recording.until_s

    @pytest.mark.slow
    def test_a_line_cut_anywhere_ends_it_at_the_mark_before(self, folder: Path) -> None:
        whole = (folder / "marks.jsonl").read_bytes()
        ends = [i + 1 for i, byte in enumerate(whole) if byte == ord("\n")]
        for size in range(0, len(whole) + 1, 3):
            (folder / "marks.jsonl").write_bytes(whole[:size])
            marks = sum(end <= size for end in ends)
            recording = read_recording(folder.parent)
            assert recording
            assert recording.mark.until_counts == [0, *CUTS, recording.mark.until_counts][marks]
            assert recording.mark.frames == marks
        for marks, cut in enumerate(CUTS, start=1):
            (folder / "marks.jsonl").write_bytes(whole[: ends[marks - 1]])
            assert_same(read_evidence(folder.parent), evidence_until(EVIDENCE, cut))

    @pytest.mark.parametrize("junk", [b"\0" * 100, b"[]", b'{"until_counts": "x"}', b'{"sizes": {"a": 1}}'])
    def test_a_line_of_junk_ends_it(self, junk: bytes, folder: Path) -> None:
        marks = (folder / "marks.jsonl").read_bytes().splitlines(keepends=True)
        (folder / "marks.jsonl").write_bytes(b"".join((*marks[:2], junk + b"\n", *marks[2:])))
        assert_same(read_evidence(folder.parent), evidence_until(EVIDENCE, CUTS[1]))

    def test_a_file_that_lost_its_end_ends_it_at_the_mark_that_it_still_reaches(self, folder: Path) -> None:
        """As after a power failure, when the system had not written everything that it held."""
        path = folder / f"{EVIDENCE.axes[0].name}_clk_rise_counts"
        path.write_bytes(path.read_bytes()[:-1])
        recording = read_recording(folder.parent)
        assert recording
        assert recording.mark.until_counts in CUTS
        assert_same(recording.evidence(), evidence_until(EVIDENCE, recording.mark.until_counts))

    def test_what_follows_the_last_mark_is_not_read(self, folder: Path) -> None:
        for path in (folder / f"{EVIDENCE.axes[0].name}_clk_rise_counts", folder / "plan.csv"):
            path.write_bytes(path.read_bytes() + b"123")
        recording = read_recording(folder.parent)
        assert recording
        assert_same(recording.evidence(), EVIDENCE)
        assert recording.plan_text() == TEXT

    @pytest.mark.parametrize(
        "text",
        [
            "",
            "{}",
            '{"folder_version": 2}',
            '{"folder_version": 1, "robot": 5}',
        ],
    )
    def test_a_damaged_header_is_named(self, text: str, folder: Path) -> None:
        (folder / "header.json").write_text(text)
        with refusing(InputError):
            read_evidence(folder.parent)


class FullDisk:
    """Lets a number of appends pass and takes only half of the next one."""

    def __init__(self, appends: int) -> None:
        self.left = appends

    def __call__(self, path: Path, data: bytes) -> None:
        self.left -= 1
        if self.left >= 0:
            append(path, data)
            return
        append(path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


class TestAFullDisk:
    @pytest.mark.slow
    def test_it_ends_the_recording_wherever_it_fills_up(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        made = list(pieces(EVIDENCE, CUTS))
        failures = set()
        for appends in range(1000):
            folder = tmp_path / str(appends)
            recording = begin(folder)
            monkeypatch.setattr(recording_module, "append", FullDisk(appends))
            for piece in made:
                recording.append(piece)
            monkeypatch.undo()
            if not recording.failure:
                break
            read = read_recording(folder)
            assert read
            assert_same(read.evidence().axes, evidence_until(EVIDENCE, read.mark.until_counts).axes)
            assert read.mark.until_counts in (0, *CUTS)
            end = f"No space left on device: the recording in {folder} ends at {read.until_s:.3f} s"
            assert str(recording.failure).startswith(f"{folder}/")
            assert str(recording.failure).endswith(end)
            failures.add(str(recording.failure).split(":")[0].removeprefix(f"{folder}/"))
            recording.finish({})
            assert read_recording(folder) == read
        assert {"bus.log", "recording.part/marks.jsonl", "recording.part/plan.csv"} < failures

    @pytest.mark.parametrize("name", ["trajectory.csv", "edges.npz", "report.json"])
    def test_the_files_that_complete_it(self, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Nothing is lost, and no empty file remains."""
        recording = record(tmp_path, EVIDENCE, CUTS)
        real = whole_file.replacement

        @contextmanager
        def on_a_full_disk(path: Path) -> Iterator[Path]:
            with real(path) as part:
                yield Path("/dev/full") if path.name == name else part

        monkeypatch.setattr(whole_file, "replacement", on_a_full_disk)
        recording.finish({})
        assert str(recording.failure).startswith(f"{tmp_path / name}: No space left on device: the recording in")
        assert not (tmp_path / name).exists()
        assert not list(tmp_path.glob("*.*.part"))
        assert_same(read_evidence(tmp_path), EVIDENCE)
