"""Files that were made to harm: every command ends with one line, or prints them without harm."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from tests.end_to_end.command_line import refusal
from tests.host.record.folder.stored import arrays_of

ESCAPES = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e\ud800\n[bold]FAKE: PASSED"
SHOWN = r"\x1b]0;owned\x07\x1b[2J\x9b31m\u202e\ud800\n[bold]FAKE: PASSED"


@pytest.fixture
def folder(carry_run: Path, tmp_path: Path) -> Path:
    return shutil.copytree(carry_run, tmp_path / "run")


def with_report(folder: Path, **values: Any) -> None:
    path = folder / "report.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def with_arrays(folder: Path, **arrays: Any) -> None:
    np.savez(folder / "edges.npz", **arrays_of(folder / "edges.npz") | arrays)


class TestEscapes:
    def test_of_a_report(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        with_report(folder, robot=ESCAPES, job=ESCAPES, driver_profile=ESCAPES)
        assert run(["verify", str(folder)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == f"drivers: {SHOWN}"
        assert lines[-1] == f"{SHOWN} {SHOWN}: PASSED"
        assert all(line.isprintable() for line in lines)

    def test_of_a_fault(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        fault = {"message": ESCAPES, "codes": {}, "joints": {ESCAPES: 1.0}, "positions_agree": True}
        with_report(folder, fault=fault, passed=False)
        assert run(["verify", str(folder)]) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert line.isprintable()
        assert line.startswith(r"steptwin: \x1b]0;owned")

    def test_of_edges(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        rules = arrays_of(folder / "edges.npz")["th1_limit_units"].size
        harmless = ESCAPES.replace("\ud800", "")
        violations = {"counts": np.array([100]), "which": np.array([0], np.int8), "values": np.array([1.0])}
        limits = {key: np.array([harmless] * rules) for key in ("rules", "broken", "units", "sources")}
        with_arrays(
            folder,
            **{f"th1_violation_{key}": values for key, values in violations.items()},
            **{f"th1_limit_{key}": values for key, values in limits.items()},
        )
        assert run(["verify", str(folder)]) == 1
        out = capsys.readouterr().out
        assert all(line.isprintable() for line in out.splitlines())
        assert r"\x1b]0;owned" in out

    def test_of_names_of_files(self, capsys: pytest.CaptureFixture[str]) -> None:
        for words in (["run", "teaching-scara", f"{ESCAPES}.csv"], ["fk", f"{ESCAPES}.toml"], ["verify", ESCAPES]):
            assert refusal(capsys, *words).isprintable()

    def test_of_words_of_the_command_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        for words in ([ESCAPES], ["jobs", ESCAPES], ["run", "teaching-scara", ESCAPES], ["jobs", f"--{ESCAPES}"]):
            assert refusal(capsys, *words).isprintable()

    def test_of_a_robot_file_are_refused(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        path = tmp_path / "mine.toml"
        path.write_text(load_robot("teaching-scara").toml.replace('"teaching-scara"', r'"a\u001b[31m"', 1))
        told = rf"{path}: name: 'a\x1b[31m' has characters that cannot be printed"
        assert refusal(capsys, "fk", str(path), *"0000") == told


class TestReports:
    @pytest.mark.parametrize(
        ("values", "exit_code"),
        [
            ({"wall_s": 0}, 0),
            ({"wall_s": -1}, 2),
            ({"wall_s": 10**400}, 2),
            ({"simulated_s": 0.5}, 1),
            ({"duration_s": 10**400}, 2),
            ({"bus": {"bitrate": 10**400, "frames": 1, "load_percent": 1}}, 2),
            ({"bus": {"bitrate": 1, "frames": 1, "load_percent": 10**400}}, 2),
            ({"folder_version": 10**400}, 2),
            ({"axes": [{"name": 10**400}] * 4}, 1),
            ({"outputs": [{"name": "x", "on": True, "from_s": 0, "until_s": 1e9}]}, 1),
        ],
    )
    def test_odd_figures(
        self, values: dict[str, Any], exit_code: int, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with_report(folder, **values)
        assert run(["verify", str(folder)]) == exit_code
        assert len(capsys.readouterr().err.splitlines()) == (exit_code == 2)

    def test_too_long(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        with (folder / "report.json").open("r+b") as file:
            file.truncate(16 * 2**20 + 1)
        refusal(capsys, "verify", str(folder))


class TestEdges:
    def test_without_axes(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        with_arrays(folder, axes=np.array([], np.str_))
        told = f"{folder}/edges.npz: axes: has 0 names, not 1 to 8 different ones"
        assert refusal(capsys, "trace", str(folder)) == told

    @pytest.mark.parametrize("form", ["vcd", "vcd-full"])
    def test_of_another_robot(self, form: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (folder / "robot.toml").write_text(load_robot("lab-scara").toml)
        told = f"{folder}/edges.npz: axes: th1 th2 d3 th4, but robot.toml has d1 th2 th3 th4"
        assert refusal(capsys, "trace", str(folder), "--format", form) == told

    def test_a_pulse_that_does_not_end(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        falls = arrays_of(folder / "edges.npz")["th1_clk_fall_counts"]
        for last, told in (
            ((1 << 63) - 1, f"goes up to {(1 << 63) - 1} counts, beyond {1 << 53}"),
            (1 << 53, "th1: an edge at 125099989.649 s since power-up, but report.json says simulated_s = "),
        ):
            falls[-1] = last
            with_arrays(folder, th1_clk_fall_counts=falls)
            assert run(["verify", str(folder)]) == 1
            captured = capsys.readouterr()
            assert told in captured.out + captured.err

    def test_a_plan_of_more_steps_than_fit(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (folder / "trajectory.csv").write_text("t,th1,th2,d3,th4\n0,0,0,0,0\n2,1e9,0,0,0\n")
        told = "th1: from its count at the start, the plan takes more than 67108864 steps"
        assert refusal(capsys, "verify", str(folder)) == told


class TestBusLogs:
    @pytest.mark.parametrize(
        "line",
        [
            f"({'9' * 5000}.000000) steptwin0 190#00",
            "(99999999999.000000) steptwin0 190#00",
            "(0000000000.000000) steptwin0 190#0",
            "(0000000000.000000) steptwin0 190#000000000000000000",
            "(0000000000.000000) steptwin0 800#00",
            "x" * 300,
            "\x00",
        ],
    )
    def test_a_line_of_another_kind_is_named(self, line: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        log = folder / "bus.log"
        log.write_text(f"(0000000000.000001) steptwin0 190#00\n{line}\n")
        told = f"{log}: line 2: is not in candump's format"
        assert refusal(capsys, "trace", str(folder), "--format", "vcd-full") == told

    def test_lines_in_another_order_are_refused(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        log = folder / "bus.log"
        log.write_text("(0000000000.000001) steptwin0 190#00\n(0000000000.000000) steptwin0 190#00\n")
        told = f"{log}: the instants are not in order of time"
        assert refusal(capsys, "trace", str(folder), "--format", "vcd-full") == told


def test_numbers_of_the_command_line_have_one_notation(capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "fk", "teaching-scara", "1_0", "0", "0", "0")
    refusal(capsys, "run", "teaching-scara", "carry", "-o", "depth_mm=１")
    refusal(capsys, "monitor", "--node", "1_0")


@pytest.mark.live
def test_too_little_memory_is_one_line(folder: Path) -> None:
    """The process may take 256 MiB more than it has at its start; the ideal steps of the plan take more."""
    resource = pytest.importorskip("resource", reason="the system has no limits for processes")
    assert resource.RLIMIT_AS
    (folder / "trajectory.csv").write_text("t,th1,th2,d3,th4\n0,0,0,0,0\n3600,1000000,0,0,0\n")
    program = (
        "import resource, sys\n"
        "import scipy.interpolate\n"
        "from steptwin.host.cli.app import run\n"
        "import steptwin.host.record.folder\n"
        "pages = int(open('/proc/self/statm').read().split()[0])\n"
        "limit = pages * resource.getpagesize() + (1 << 28)\n"
        "resource.setrlimit(resource.RLIMIT_AS, (limit, limit))\n"
        "sys.exit(run(['verify', sys.argv[1]]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(folder)], capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode, done.stderr) == (2, "steptwin: the input takes more memory than there is\n")
