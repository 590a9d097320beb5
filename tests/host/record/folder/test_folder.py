"""Write and read folders: every file reads back as written, and an error names file and key."""

import errno
import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motions.sampled import c2_spline
from steptwin.host.planning.planner import plan
from steptwin.host.record.folder import ContradictionError, read_edges, read_run
from steptwin.host.record.folder.edges_file import write_edges
from steptwin.host.record.folder.motion import read_motion, write_motion
from steptwin.host.robots import load_robot
from steptwin.host.verify import Evidence
from tests.host.record.folder.stored import EVIDENCE, FINE, arrays_of, assert_same
from tests.messages import refusing


@pytest.mark.parametrize("evidence", [EVIDENCE, FINE], ids=["sixteenths", "fine"])
def test_evidence_reads_back_as_written(evidence: Evidence, tmp_path: Path) -> None:
    write_edges(tmp_path / "edges.npz", evidence)
    assert_same(read_edges(tmp_path), evidence)


def test_angles_are_in_sixteenths_unless_a_driver_has_finer_steps(tmp_path: Path) -> None:
    """So the files of before have no unit, and are read."""
    write_edges(tmp_path / "edges.npz", FINE)
    with np.load(tmp_path / "edges.npz") as arrays:
        assert (arrays["a_phase_substeps"].dtype, arrays["b_phase_sixteenths"].dtype) == (np.int32, np.int8)
        assert arrays["a_substeps_per_full_step"] == 16_000
        assert not {"a_phase_sixteenths", "b_phase_substeps", "b_substeps_per_full_step"} & set(arrays.files)


class TestInterruptedWriting:
    """The file of an earlier run stays as it was."""

    @pytest.fixture(autouse=True)
    def _older(self, tmp_path: Path) -> Iterator[None]:
        path = tmp_path / "file"
        path.write_bytes(b"old")
        yield
        assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == {"file": b"old"}

    def test_of_edges(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def full(file: BinaryIO, **_: object) -> None:
            file.write(b"half")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(np, "savez_compressed", full)
        with refusing(OSError):
            write_edges(tmp_path / "file", EVIDENCE)

    def test_of_the_motion(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def interrupted(*_: object) -> str:
            raise KeyboardInterrupt

        robot = load_robot("teaching-scara")
        monkeypatch.setattr("steptwin.host.record.folder.motion.trajectory_row", interrupted)
        with pytest.raises(KeyboardInterrupt):
            write_motion(tmp_path / "file", plan(robot, make_job(robot, "carry", {})))


class TestTheMotion:
    @pytest.mark.parametrize(
        ("name", "job"), [("warehouse-scara", "store"), ("hybrid-arm", "five-points"), ("lab-scara", "spiral")]
    )
    def test_reads_back_to_a_ten_thousandth_of_a_step(self, name: str, job: str, tmp_path: Path) -> None:
        robot = load_robot(name)
        made = plan(robot, make_job(robot, job, {}))
        write_motion(tmp_path / "trajectory.csv", made)
        again = read_motion(tmp_path, robot, made.motion.output_changes)
        assert again.duration_s == made.motion.duration_s
        assert again.output_changes == made.motion.output_changes
        t_s = np.linspace(0.0, again.duration_s, 20_001)
        off = np.abs(again.positions(t_s) - made.motion.positions(t_s)) * robot.steps_per_unit
        assert off.max() <= 1e-4
        assert len((tmp_path / "trajectory.csv").read_text().splitlines()) == 1 + len(made.times_ms)

    def test_has_a_row_for_every_millisecond_if_points_are_too_far_apart(self, tmp_path: Path) -> None:
        """The spline goes through points 3 ms apart in its middle, which cubics of 10 ms miss."""
        robot = load_robot("teaching-scara")
        times_s = np.array([0.0, 0.2, 0.203, 0.206, 0.4])
        positions = np.zeros((5, 4))
        positions[2, 0] = 0.003
        made = plan(robot, c2_spline(robot.joint_names, times_s, positions))
        write_motion(tmp_path / "trajectory.csv", made)
        assert len((tmp_path / "trajectory.csv").read_text().splitlines()) == 1 + 401
        t_s = np.linspace(0.0, 0.4, 4001)
        again = read_motion(tmp_path, robot, ())
        off = np.abs(again.positions(t_s) - made.motion.positions(t_s)) * robot.steps_per_unit
        assert off.max() <= 1e-4

    @pytest.mark.parametrize(("bump_deg", "rows"), [(7.0e-6, 1 + 41), (7.1e-6, 1 + 401)])
    def test_points_suffice_up_to_a_ten_thousandth_of_a_step(self, bump_deg: float, rows: int, tmp_path: Path) -> None:
        """A bump of 1e-6 degrees puts the cubics 1.418e-5 steps away from the motion."""
        robot = load_robot("teaching-scara")
        positions = np.zeros((5, 4))
        positions[2, 0] = bump_deg
        spline = c2_spline(robot.joint_names, np.array([0.0, 0.2, 0.203, 0.206, 0.4]), positions)
        write_motion(tmp_path / "trajectory.csv", plan(robot, spline))
        assert len((tmp_path / "trajectory.csv").read_text().splitlines()) == rows


class TestTheColumnsBesideTheMotion:
    """They are those of the cubics between the points, whatever reads them."""

    @staticmethod
    def columns(tmp_path: Path, name: str, job: str) -> dict[str, FloatArray]:
        robot = load_robot(name)
        write_motion(tmp_path / "trajectory.csv", plan(robot, make_job(robot, job, {})))
        names, *rows = (line.split(",") for line in (tmp_path / "trajectory.csv").read_text().splitlines())
        return dict(zip(names, np.array(rows, dtype=np.float64).T, strict=True))

    def test_are_the_papers_accelerations_and_tool_positions(self, tmp_path: Path) -> None:
        """A cubic in time falls from 6 dq / T^2 to the opposite; the tool points up at the attitude 0."""
        found = self.columns(tmp_path, "teaching-scara", "carry")
        for joint, first in (("th1", -179.537), ("th2", 517.003), ("d3", 0.0), ("th4", -337.466)):
            assert found[f"a_{joint}"] == pytest.approx(first * (1.0 - 2.0 * found["t"]), abs=1e-3)
        assert found["tool_x"][[0, 15, -1]] == pytest.approx([194.999999145, 194.773546708, 137.888910092], abs=1e-6)
        assert found["tool_y"][[0, 15, -1]] == pytest.approx([0.005710000, 2.952128885, 35.753580548], abs=1e-6)
        assert found["tool_z"] == pytest.approx(np.full(101, -40.0))
        assert found["tool_phi"] == pytest.approx(np.zeros(101), abs=1e-4)
        for axis, direction in (("n", "x"), ("o", "y")):
            for coordinate in "xyz":
                cosine = found[f"tool_{axis}{coordinate}"]
                assert cosine == pytest.approx(np.full(101, float(coordinate == direction)), abs=2e-6)

    def test_are_the_attitude_of_a_tool_that_points_down(self, tmp_path: Path) -> None:
        """psi = 60 + -45 - 90 degrees at the end; n = (cos, sin, 0), o = (sin, -cos, 0), n x o points down."""
        found = self.columns(tmp_path, "calibration-scara", "demo")
        psi = np.deg2rad(found["th1"] + found["th2"] - found["th4"])
        assert found["tool_phi"][-1] == pytest.approx(-75.0)
        axes = {
            "nx": np.cos(psi),
            "ny": np.sin(psi),
            "nz": 0 * psi,
            "ox": np.sin(psi),
            "oy": -np.cos(psi),
            "oz": 0 * psi,
        }
        for name, expected in axes.items():
            assert found[f"tool_{name}"] == pytest.approx(expected, abs=1e-9)


def test_a_run_reads_back_as_written(store_run: Path) -> None:
    stored = read_run(store_run)
    document = json.loads((store_run / "report.json").read_text())
    assert (stored.robot.name, stored.report.run.job) == ("warehouse-scara", "store")
    assert stored.robot == load_robot("warehouse-scara")
    assert stored.report.document == document
    assert [switching.output for switching in stored.report.output_changes] == [o["name"] for o in document["outputs"]]
    start_s = stored.comparison.evidence.start_counts / 72e6
    changed_s = [change.counts / 72e6 - start_s for change in stored.comparison.evidence.outputs]
    assert changed_s == pytest.approx([o["changed_s"] for o in document["outputs"]])


# --- files that cannot be read


def refusal_of_edges(tmp_path: Path, change: Callable[[dict[str, Any]], object]) -> InputError:
    write_edges(tmp_path / "edges.npz", EVIDENCE)
    arrays = arrays_of(tmp_path / "edges.npz")
    change(arrays)
    np.savez_compressed(tmp_path / "edges.npz", **arrays)
    with pytest.raises(InputError) as caught:
        read_edges(tmp_path)
    assert str(caught.value).startswith(f"{tmp_path / 'edges.npz'}: ")
    return caught.value


def said(error: InputError) -> str:
    return str(error).split("edges.npz: ", maxsplit=1)[1]


@pytest.mark.parametrize("key", [*["folder_version", "counts_per_second", "start_counts", "axes"], *(
    f"b_{what}" for what in (
        "start_steps", "active_edge", "clk_rise_counts", "clk_fall_counts", "dir_edge_counts", "dir_levels",
        "step_counts", "step_signs", "violation_counts", "violation_which", "violation_values", "limit_rules",
        "limit_broken", "limit_values", "limit_units", "limit_sources", "phase_counts", "phase_sixteenths",
        "phase_a_ma", "phase_b_ma", "reset_counts", "reset_levels", "out2_counts", "out2_levels", "dcy1_levels",
    )
)])  # fmt: skip
def test_a_missing_key_is_named(key: str, tmp_path: Path) -> None:
    assert said(refusal_of_edges(tmp_path, lambda arrays: arrays.pop(key))) == f"{key}: is missing"


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("folder_version", np.int64(2), "folder_version: is 2; this steptwin reads 1"),
        ("counts_per_second", np.int64(1_000_000), "counts_per_second: 1000000 is not 72000000"),
        ("start_counts", np.float64(1.5), "start_counts: is not one whole number"),
        ("start_counts", np.array([1, 2]), "start_counts: is not one whole number"),
        ("axes", np.array([1, 2]), "axes: is not a list of names"),
        ("a_active_edge", np.array(["rising"]), "a_active_edge: is not one text"),
        ("a_active_edge", np.array("both"), "a_active_edge: 'both' is not one of rising, falling"),
        ("a_clk_rise_counts", np.array([1.0]), "a_clk_rise_counts: is not a list of whole numbers"),
        ("a_clk_rise_counts", np.array([[1], [2]]), "a_clk_rise_counts: is not a list of whole numbers"),
        ("a_violation_values", np.array([1, 2]), "a_violation_values: is not a list of numbers"),
        ("a_limit_units", np.array([1, 2]), "a_limit_units: is not a list of names"),
    ],
)
def test_a_value_of_another_kind_is_refused(key: str, value: object, message: str, tmp_path: Path) -> None:
    error = refusal_of_edges(tmp_path, lambda arrays: arrays.update({key: value}))
    assert said(error) == message
    assert not isinstance(error, ContradictionError)


COUNT = EVIDENCE.axes[0].clk_rise_counts.size


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("a_clk_rise_counts", lambda v: v[1:], f"{COUNT - 1} values, but a_clk_fall_counts has {COUNT}"),
        ("a_clk_rise_counts", lambda v: np.roll(v, 1), "the instants are not in order of time"),
        ("a_clk_rise_counts", lambda v: v + 5_000, "the instants do not alternate with a_clk_fall_counts"),
        ("a_clk_fall_counts", lambda v: v + 200_000, "the instants do not alternate with a_clk_fall_counts"),
        ("a_step_counts", lambda v: v - v[0] - 1, "the instants are not in order of time"),
        ("a_step_signs", lambda v: v[1:], f"{COUNT - 1} values, but a_step_counts has {COUNT}"),
        ("a_step_signs", lambda v: v * 0, "contains other numbers than -1 and 1"),
        ("a_dir_levels", lambda v: v * 2, "goes from 2 to 2, beyond 0..1"),
        ("a_enable_levels", lambda v: v[1:], "0 values, but a_enable_counts has 1"),
        ("a_violation_which", lambda v: v + 1, "goes from 1 to 2, beyond 0..1"),
        ("a_violation_values", lambda v: v[1:], "1 values, but a_violation_counts has 2"),
        ("a_limit_values", lambda v: v[1:], "1 values, but a_limit_rules has 2"),
        ("a_limit_sources", lambda v: v[1:], "2 values, but the texts or units have another number"),
        ("a_phase_sixteenths", lambda v: v + np.int8(1), "goes from 1 to 64, beyond 0..63"),
        ("a_phase_a_ma", lambda v: v.astype(np.int64) * 100, "goes from -151500 to 0, beyond -32768..32767"),
        ("a_phase_b_ma", lambda v: v[1:], "1 values, but a_phase_counts has 2"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    key: str, change: Callable[[Any], Any], message: str, tmp_path: Path
) -> None:
    error = refusal_of_edges(tmp_path, lambda arrays: arrays.update({key: change(arrays[key])}))
    assert said(error).endswith(message)
    assert isinstance(error, ContradictionError)


@pytest.mark.parametrize("content", [b"", b"junk", b"PK\x03\x04", b"\x93NUMPY\x01\x00"])
def test_a_file_of_another_kind_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "edges.npz").write_bytes(content)
    with refusing(InputError):
        read_edges(tmp_path)


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    write_edges(tmp_path / "edges.npz", EVIDENCE)
    content = bytearray((tmp_path / "edges.npz").read_bytes())
    middle = content.index(b"a_clk_rise_counts.npy") + 60
    content[middle : middle + 40] = bytes(40)
    (tmp_path / "edges.npz").write_bytes(content)
    with refusing(InputError):
        read_edges(tmp_path)


def test_objects_are_not_unpickled(tmp_path: Path) -> None:
    error = refusal_of_edges(tmp_path, lambda arrays: arrays.update(axes=np.array([{}, None], dtype=object)))
    assert said(error) == "axes: is not an array of whole numbers, floats or texts"


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with refusing(InputError):
        read_run(tmp_path / "nowhere")


@pytest.mark.parametrize("name", ["report.json", "robot.toml", "trajectory.csv", "edges.npz"])
def test_a_missing_file_is_named(name: str, store_run: Path, tmp_path: Path) -> None:
    shutil.copytree(store_run, tmp_path / "copy")
    (tmp_path / "copy" / name).unlink()
    with pytest.raises(InputError) as caught:
        read_run(tmp_path / "copy")
    assert str(caught.value) == f"{tmp_path / 'copy' / name}: is missing"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("folder_version"), "folder_version: is None; this steptwin reads 1"),
        (lambda d: d.update(folder_version="1"), "folder_version: is '1'; this steptwin reads 1"),
        (lambda d: d.pop("job"), "job: is missing"),
        (lambda d: d.update(job=3), "job: 3 is not a text"),
        (lambda d: d.update(wall_s="long"), "wall_s: 'long' is not a number"),
        (lambda d: d.update(wall_s=True), "wall_s: True is not a number"),
        (lambda d: d["bus"].pop("frames"), "bus.frames: is missing"),
        (lambda d: d["bus"].update(bitrate=1.5), "bus.bitrate: 1.5 is not a whole number"),
        (lambda d: d.update(bus=[]), "bus: [] is not a JSON object"),
        (lambda d: d.update(passed=1), "passed: 1 is neither true nor false"),
        (lambda d: d.update(outputs={}), "outputs: {} is not a list"),
        (lambda d: d["outputs"][1].pop("until_s"), "outputs[1]: until_s: is missing"),
        (lambda d: d.update(axes=[1]), "axes[0]: 1 is not a JSON object"),
        (lambda d: d.update(fault={"message": "", "positions_agree": True}), "fault.joints: is missing"),
    ],
)
def test_a_report_with_a_wrong_value_is_refused(
    change: Callable[[dict[str, Any]], object], message: str, store_run: Path, tmp_path: Path
) -> None:
    shutil.copytree(store_run, tmp_path / "copy")
    path = tmp_path / "copy" / "report.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_run(tmp_path / "copy")
    assert str(caught.value) == f"{path}: {message}"


@pytest.mark.parametrize("text", ["", "{", "[]", "\xff"])
def test_a_report_that_is_not_a_json_object_is_refused(text: str, store_run: Path, tmp_path: Path) -> None:
    shutil.copytree(store_run, tmp_path / "copy")
    (tmp_path / "copy" / "report.json").write_text(text, encoding="latin-1")
    with refusing(InputError):
        read_run(tmp_path / "copy")


def test_axes_of_another_robot_are_refused(store_run: Path, tmp_path: Path) -> None:
    shutil.copytree(store_run, tmp_path / "copy")
    write_edges(tmp_path / "copy" / "edges.npz", EVIDENCE)
    with refusing(InputError):
        read_run(tmp_path / "copy")


def test_the_version_written_is_the_version_read(tmp_path: Path) -> None:
    write_edges(tmp_path / "edges.npz", EVIDENCE)
    assert arrays_of(tmp_path / "edges.npz")["folder_version"] == 1
