"""`steptwin trace` and `steptwin plot` on the folder of a run."""

import errno
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.extras import installing
from steptwin.host.record.folder import read_edges
from steptwin.host.record.waveforms import Format, HeldValues
from steptwin.host.record.waveforms.signal import Values
from tests.end_to_end.command_line import refusal
from tests.host.record.waveforms.vcd_reader import read_vcd


def _with_the_library_of(form: str) -> None:
    if form == Format.MCAP:
        pytest.importorskip("mcap", reason="the extra `mcap` is not installed")


class TestTrace:
    def test_every_edge_of_every_axis(self, carry_run: Path, tmp_path: Path) -> None:
        """At 10 ns, each instant stands for exactly one count."""
        out = tmp_path / "all.vcd"
        assert run(["trace", str(carry_run), "--timescale", "10ns", "--out", str(out)]) == 0
        dump = read_vcd(out.read_text())
        for axis in read_edges(carry_run).axes:
            edges = np.column_stack([axis.clk_rise_counts, axis.clk_fall_counts]).ravel()
            read = [round(instant * 0.72) for instant, _ in dump.changes[f"{axis.name}_step"]]
            assert read == edges.tolist()
            assert dump.initial[f"{axis.name}_enable"] == "0"
            assert [level for _, level in dump.changes[f"{axis.name}_enable"]] == ["1", "0"]
        assert dump.texts[0] == "StepTwin, SIMULATED: teaching-scara"

    def test_a_run_leaves_the_same_file_as_trace(self, carry_run: Path, tmp_path: Path) -> None:
        out = tmp_path / "again.vcd"
        assert run(["trace", str(carry_run), "--out", str(out)]) == 0
        assert out.read_bytes() == (carry_run / "trace.vcd").read_bytes()

    def test_a_window_begins_with_the_present_levels(self, carry_run: Path, tmp_path: Path) -> None:
        """At the rise of a pulse of th2, STEP is already 1; one count earlier it is 0."""
        evidence = read_edges(carry_run)
        axis = evidence.axes[1]
        rise = int(axis.clk_rise_counts[100])
        out = tmp_path / "window.vcd"
        for counts, level in ((rise - 1, "0"), (rise, "1")):
            from_s = repr((counts - evidence.start_counts) / 72e6)
            words = ["--from", from_s, "--to", "0.9", "--axis", "th2, d3", "--timescale", "10ns"]
            assert run(["trace", str(carry_run), *words, "--out", str(out), "--replace"]) == 0
            dump = read_vcd(out.read_text())
            assert dump.initial["th2_step"] == level
            assert dump.initial["th2_enable"] == "1"
            expected = axis.dir_levels[axis.dir_edge_counts <= counts]
            assert dump.initial["th2_dir"] == str(expected[-1] if expected.size else 0)
            assert {name.split("_")[0] for name in dump.types} == {"th2", "d3"}

    def test_everything_for_a_viewer(self, carry_run: Path, tmp_path: Path) -> None:
        out = tmp_path / "full.vcd"
        assert run(["trace", str(carry_run), "--format", "vcd-full", "--out", str(out)]) == 0
        dump = read_vcd(out.read_text())
        report = json.loads((carry_run / "report.json").read_text())
        for axis, start, end in zip(report["axes"], *(report["joints"][k] for k in ("start", "end")), strict=True):
            name = axis["name"]
            unit = "mm" if name == "d3" else "deg"
            steps = [dump.initial[f"{name}_steps"], *(value for _, value in dump.changes[f"{name}_steps"])]
            assert (int(steps[0]), int(steps[-1])) == (axis["steps_start"], axis["steps_end"])
            assert len(steps) == 1 + axis["pulses"]
            joint = [dump.initial[f"{name}_position_{unit}"]]
            joint += [value for _, value in dump.changes[f"{name}_position_{unit}"]]
            assert (float(joint[0]), float(joint[-1])) == pytest.approx((start, end))
            states = [state for _, state in dump.changes[f"{name}_drive_state"]]
            assert states.count("OPERATION_ENABLED") == 1

    def test_tables(self, carry_run: Path, tmp_path: Path) -> None:
        table, arrays = tmp_path / "t.csv", tmp_path / "t.npz"
        for form, out in (("csv", table), ("npz", arrays)):
            assert run(["trace", str(carry_run), "--format", form, "--from", "0.5", "--out", str(out)]) == 0
        rows = [line.split(",") for line in table.read_text().splitlines()[1:]]
        with np.load(arrays) as stored:
            counts = stored["th2_step_change_counts"].tolist()
            begin = str(stored["from_counts"])
        assert [row[0] for row in rows if row[2] == "th2_step"] == [begin, *map(str, counts)]
        assert float(rows[0][1]) == 0.5

    def test_goes_into_the_folder_by_default(self, carry_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
        capsys.readouterr()
        assert run(["trace", str(carry_run), "--format", "csv", "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
        assert document["file"] == str(carry_run / "trace.csv")
        assert (carry_run / "trace.csv").is_file()
        assert document["signals"][:3] == ["th1_step", "th1_dir", "th1_enable"]
        (carry_run / "trace.csv").unlink()

    @pytest.mark.parametrize("words", [["--from", "0.25"], ["--to", "0.25"], ["--axis", "d3"]])
    @pytest.mark.parametrize(("form", "name"), [("vcd", "trace-part.vcd"), ("vcd-full", "trace-full-part.vcd")])
    def test_a_part_leaves_the_file_of_the_whole(
        self, words: list[str], form: str, name: str, carry_run: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        whole = (carry_run / "trace.vcd").read_bytes()
        before = {*os.listdir(carry_run)}
        capsys.readouterr()
        assert run(["trace", str(carry_run), "--format", form, "--json", *words]) == 0
        assert json.loads(capsys.readouterr().out)["file"] == str(carry_run / name)
        assert {*os.listdir(carry_run)} - before == {name}
        assert (carry_run / "trace.vcd").read_bytes() == whole
        (carry_run / name).unlink()

    @pytest.mark.parametrize("words", [["--axis", "d3,th2"], ["--axis", "d3", "--axis", " th2"]])
    def test_axes_as_a_list_or_one_by_one(
        self, words: list[str], carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        capsys.readouterr()
        assert run(["trace", str(carry_run), "--out", str(tmp_path / "t.vcd"), "--json", *words]) == 0
        signals = json.loads(capsys.readouterr().out)["signals"]
        assert list(dict.fromkeys(name.split("_")[0] for name in signals)) == ["th2", "d3"]

    @pytest.mark.parametrize("form", Format)
    @pytest.mark.parametrize("name", ["er", "er.vcd"])
    def test_the_file_has_the_name_that_was_asked_for(
        self, form: str, name: str, carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        _with_the_library_of(form)
        capsys.readouterr()
        out = str(tmp_path / name)
        assert run(["trace", str(carry_run), "--format", form, "--from", "0.9", "--out", out, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["file"] == out
        assert os.listdir(tmp_path) == [name]

    @pytest.mark.parametrize("form", Format)
    @pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
    def test_broken_off_leaves_the_older_file(
        self, form: str, error: BaseException, carry_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The error comes during writing, when the changes of some signals have been read."""
        _with_the_library_of(form)
        out = tmp_path / "trace"
        out.write_bytes(b"old")
        asked = iter([False] * 3)
        between = HeldValues.between

        def broken_off(self: HeldValues, after: int, until: int) -> tuple[Int64Array, Values]:
            if next(asked, True):
                raise error
            return between(self, after, until)

        monkeypatch.setattr(HeldValues, "between", broken_off)
        assert run(["trace", str(carry_run), "--format", form, "--out", str(out)]) in (2, 130)
        assert os.listdir(tmp_path) == ["trace"]
        assert out.read_bytes() == b"old"

    @pytest.mark.parametrize(
        "words",
        [
            ["--axis", "th9"],
            ["--axis", "th2,d3", "--axis", "th2"],
            ["--from", "0.5", "--to", "0.5"],
            ["--from", "2"],
            ["--to", "-1"],
            ["--from", "nan"],
            ["--format", "vdc"],
            ["--timescale", "1ms"],
            ["--format", "csv", "--timescale", "1us"],
        ],
        ids=" ".join,
    )
    def test_bad_input(self, words: list[str], carry_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
        refusal(capsys, "trace", str(carry_run), *words)

    def test_no_folder(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for command, first in (("trace", "edges.npz"), ("plot", "report.json"), ("verify", "report.json")):
            assert refusal(capsys, command, str(tmp_path / "x")) == f"{tmp_path / 'x'}: is not a folder of a run"
            assert refusal(capsys, command, str(tmp_path)) == f"{tmp_path / first}: is missing"

    def test_needs_neither_report_nor_plan(self, carry_run: Path, tmp_path: Path) -> None:
        """Such a folder comes from a board without a planned motion."""
        for name in ("edges.npz", "robot.toml"):
            shutil.copy(carry_run / name, tmp_path)
        assert run(["trace", str(tmp_path)]) == 0
        assert (tmp_path / "trace.vcd").read_bytes() == (carry_run / "trace.vcd").read_bytes()


class TestPlot:
    @pytest.fixture(autouse=True)
    def _matplotlib(self) -> None:
        pytest.importorskip("matplotlib", reason="the extra `plot` (matplotlib) is not installed")

    @pytest.mark.slow
    def test_chosen_pictures(self, carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        capsys.readouterr()
        words = ["--what", "edges, jitter", "--format", "svg", "--at", "0.5", "--span", "0.004"]
        assert run(["plot", str(carry_run), *words, "--out", str(tmp_path / "new")]) == 0
        paths = [tmp_path / "new" / name for name in ("edges.svg", "jitter.svg")]
        assert capsys.readouterr().out.split() == [str(path) for path in paths]
        for path in paths:
            assert path.read_text().startswith("<?xml")

    @pytest.mark.slow
    def test_a_live_boards_folder_takes_the_plan_of_another(
        self, carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """The folder is one of a served board that does not know its plan."""
        live, words = tmp_path / "live", ["--what", "tool-path,edges", "--format", "svg"]
        shutil.copytree(carry_run, live)
        (live / "trajectory.csv").unlink()
        document = json.loads((live / "report.json").read_text())
        (live / "report.json").write_text(json.dumps(document | {"passed": None, "outputs": []}))
        refusal(capsys, "plot", str(live))
        assert run(["plot", str(live), *words, "--plan", str(carry_run)]) == 0
        assert run(["plot", str(carry_run), *words, "--out", str(tmp_path)]) == 0
        for name in ("tool-path.svg", "edges.svg"):
            assert (live / name).read_bytes() == (tmp_path / name).read_bytes()
        own = refusal(capsys, "plot", str(carry_run), "--plan", str(carry_run))
        assert own.endswith(" has its own plan; only a live board's folder takes another")

    @pytest.mark.parametrize(
        "words",
        [
            ["--what", "edgs"],
            ["--what", "joints", "--what", "error,joints"],
            ["--what", ""],
            ["--at", "1.5"],
            ["--at", "nan"],
            ["--span", "0"],
            ["--span", "1.3e-8"],
            ["--span", "1.1"],
            ["--what", "joints,error", "--at", "0.5"],
            ["--format", "jpg"],
        ],
        ids=" ".join,
    )
    def test_bad_input(self, words: list[str], carry_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
        refusal(capsys, "plot", str(carry_run), *words)

    def test_without_matplotlib(
        self, carry_run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr("steptwin.host.cli.files.plot.find_spec", lambda _: None)
        line = refusal(capsys, "plot", str(carry_run))
        assert line == f"plot: matplotlib is not installed ({installing('plot')})"
