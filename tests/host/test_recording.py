"""The folder of a run: what is written in one go and what is spooled are the same, and are read again."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.pins import Pin, PinChange
from host.errors import InputError
from host.recording import AxisTotals, EdgeSpool, PinLog, read_edges, read_evidence, read_outputs, write_edges
from host.robots import load_robot
from host.verify import AxisEvidence, Evidence, OutputChange

ROBOT = load_robot("warehouse-scara")
COUNTS = st.lists(st.integers(0, 1 << 60))


def axis_of(name: str, start_steps: int, instants: list[int]) -> AxisEvidence:
    """An axis whose pulses begin at these counts."""
    rises = np.array(sorted(instants), dtype=np.int64)
    return AxisEvidence(
        name=name,
        start_steps=start_steps,
        clk_rise_counts=rises,
        clk_fall_counts=rises + 2400,
        dir_edge_counts=rises[::3],
        dir_levels=np.arange(rises[::3].size, dtype=np.int8) % 2,
        step_counts=rises[::2],
        step_signs=np.where(rises[::2] % 2, 1, -1).astype(np.int8),
        violations=rises.size // 2,
    )


def same(one: AxisEvidence, other: AxisEvidence) -> bool:
    return all(np.array_equal(getattr(one, field), getattr(other, field)) for field in AxisEvidence.__slots__)


def spooled(path: Path, pieces: list[AxisEvidence], start_counts: int | None) -> None:
    spool = EdgeSpool(path, ("th1", "L_1"))
    for piece in pieces:
        spool.append(piece)
    totals = {piece.name: AxisTotals(piece.name, piece.start_steps, 0) for piece in reversed(pieces)}
    for piece in pieces:
        totals[piece.name] = totals[piece.name]._replace(violations=totals[piece.name].violations + piece.violations)
    spool.finish(start_counts, [totals["th1"], totals["L_1"]])


@given(COUNTS, COUNTS, st.integers(-(1 << 31), 1 << 31), st.integers(0, 1 << 60))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, first: list[int], second: list[int], start_steps: int, start_counts: int
) -> None:
    axes = (axis_of("th1", start_steps, first), axis_of("L_1", 0, second))
    path = tmp_path_factory.mktemp("run") / "edges.npz"
    write_edges(path, Evidence(start_counts, axes))
    written = read_edges(path)
    spooled(path, list(axes), start_counts)
    assert [entry.name for entry in path.parent.iterdir()] == ["edges.npz"]
    for read in (written, read_edges(path)):
        assert read.start_counts == start_counts
        assert all(same(got, given) for got, given in zip(read.axes, axes, strict=True))


def test_pieces_are_joined(tmp_path: Path) -> None:
    path = tmp_path / "edges.npz"
    spooled(path, [axis_of("th1", 7, [1, 2, 3]), axis_of("L_1", 0, []), axis_of("th1", 7, [4, 5])], None)
    read = read_edges(path)
    assert read.start_counts is None
    th1, other = read.axes
    assert th1.clk_rise_counts.tolist() == [1, 2, 3, 4, 5]
    assert (th1.start_steps, th1.violations) == (7, 2)
    assert (other.name, other.clk_rise_counts.size) == ("L_1", 0)


def test_equal_edges_make_equal_files(tmp_path: Path) -> None:
    for name in ("one.npz", "two.npz"):
        spooled(tmp_path / name, [axis_of("th1", 0, [1, 2]), axis_of("L_1", 0, [9])], 5)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_a_run_that_is_killed_leaves_its_edges(tmp_path: Path) -> None:
    spool = EdgeSpool(tmp_path / "edges.npz", ("th1",))
    spool.append(axis_of("th1", 0, [5, 6, 7]))
    part = tmp_path / "edges.part" / "th1_clk_rise_counts"
    assert np.fromfile(part, dtype="<i8").tolist() == [5, 6, 7]
    spool.finish(None, [AxisTotals("th1", 0, 0)])


def test_a_new_run_takes_the_place_of_an_old_one(tmp_path: Path) -> None:
    """Also of one that was killed."""
    path = tmp_path / "edges.npz"
    write_edges(path, Evidence(0, (axis_of("th1", 0, [1]),)))
    (tmp_path / "edges.part").mkdir()
    (tmp_path / "edges.part" / "old").write_bytes(b"old")
    spool = EdgeSpool(path, ("th1",))
    assert not path.exists()
    spool.finish(None, [AxisTotals("th1", 0, 0)])
    assert [entry.name for entry in tmp_path.iterdir()] == ["edges.npz"]


CHANGES = [PinChange(0, 0, Pin.RESET, 1), PinChange(1000, 5, Pin.OUT1, 1), PinChange(2000, 5, Pin.OUT1, 0)]


def write_pins(path: Path, changes: list[PinChange]) -> None:
    with path.open("w", encoding="utf-8") as file:
        PinLog(file, ROBOT).append(changes)


def test_pins(tmp_path: Path) -> None:
    path = tmp_path / "pins.csv"
    write_pins(path, CHANGES)
    (name,) = (name for name, output in ROBOT.outputs.items() if (output.joint, output.out) == ("th3", 1))
    assert path.read_text() == (
        f"counts,joint,pin,level,output\n0,sx,RESET,1,\n1000,th3,OUT1,1,{name}\n2000,th3,OUT1,0,{name}\n"
    )
    assert read_outputs(path) == (OutputChange(name, 1000, 1), OutputChange(name, 2000, 0))


def test_the_evidence_of_a_folder(tmp_path: Path) -> None:
    axis = axis_of("th1", 3, [10, 20])
    write_edges(tmp_path / "edges.npz", Evidence(10, (axis,)))
    write_pins(tmp_path / "pins.csv", CHANGES)
    evidence = read_evidence(tmp_path)
    assert evidence.start_counts == 10
    assert same(evidence.axes[0], axis)
    assert len(evidence.outputs) == 2


class TestWhatIsNoFolderOfARun:
    @pytest.mark.parametrize("content", [b"", b"junk", b"PK\x03\x04"])
    def test_edges(self, tmp_path: Path, content: bytes) -> None:
        (tmp_path / "edges.npz").write_bytes(content)
        with pytest.raises(InputError, match=r"edges\.npz"):
            read_edges(tmp_path / "edges.npz")

    def test_other_arrays(self, tmp_path: Path) -> None:
        np.savez(tmp_path / "edges.npz", th1_start_steps=1)
        with pytest.raises(InputError, match=r"edges\.npz: is no edges\.npz: .*th1_violations"):
            read_edges(tmp_path / "edges.npz")

    def test_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match=r"edges\.npz: No such file"):
            read_edges(tmp_path / "edges.npz")
        with pytest.raises(InputError, match=r"pins\.csv: No such file"):
            read_outputs(tmp_path / "pins.csv")

    @pytest.mark.parametrize("text", ["", "a,b\n", "counts,joint,pin,level,output\nx,th1,OUT1,1,magnet\n"])
    def test_pins(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "pins.csv").write_text(text)
        with pytest.raises(InputError, match=r"pins\.csv"):
            read_outputs(tmp_path / "pins.csv")

    def test_no_motion(self, tmp_path: Path) -> None:
        EdgeSpool(tmp_path / "edges.npz", ("th1",)).finish(None, [AxisTotals("th1", 0, 0)])
        with pytest.raises(InputError, match="no SYNC has started a motion"):
            read_evidence(tmp_path)
