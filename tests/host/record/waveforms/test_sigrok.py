"""Read VCD files with sigrok's own import and stepper decoder: it counts the same steps as the drivers."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_edges
from steptwin.host.record.waveforms import SCALES

SIGROK = shutil.which("sigrok-cli")
pytestmark = pytest.mark.skipif(SIGROK is None, reason="sigrok-cli is not installed (apt install sigrok-cli)")

POSITION = re.compile(r"(\d+)-(\d+) stepper_motor-1: (-?\d+) steps")


def decoded(trace: Path, axis: str) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Return for each pulse except the last: when it and the next one began, and the position between them."""
    assert SIGROK is not None
    done = subprocess.run(
        [
            SIGROK, "-i", str(trace), "-I", "vcd", "-P", f"stepper_motor:step={axis}_step:dir={axis}_dir",
            "-A", "stepper_motor=position", "--protocol-decoder-samplenum",
        ],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stderr == ""
    lines = [POSITION.fullmatch(line) for line in done.stdout.splitlines()]
    return np.array([[int(number) for number in line.groups()] for line in lines if line], np.int64).reshape(-1, 3)


@pytest.mark.slow
@pytest.mark.parametrize("scale", ["1us", "100ns"])
def test_sigrok_counts_the_drivers_steps(scale: str, carry_run: Path, tmp_path: Path) -> None:
    trace = tmp_path / "trace.vcd"
    assert run(["trace", str(carry_run), "--timescale", scale, "--out", str(trace)]) == 0
    moving = [axis for axis in read_edges(carry_run).axes if axis.step_signs.size]
    assert [axis.step_signs.size for axis in moving] == pytest.approx([1064, 3064, 1000], abs=2)
    for axis in moving:
        read = decoded(trace, axis.name)
        instants = SCALES[scale].rounded(axis.step_counts)
        np.testing.assert_array_equal(read[:, 0], instants[:-1])
        np.testing.assert_array_equal(read[:, 1], instants[1:])
        np.testing.assert_array_equal(read[:, 2], np.cumsum(axis.step_signs[:-1], dtype=np.int64))


@pytest.mark.slow
def test_sigrok_reads_the_file_of_a_run(store_run: Path) -> None:
    """The run lasts 9 s with pauses; th2 moves to and fro."""
    axis = next(axis for axis in read_edges(store_run).axes if axis.name == "th2")
    assert np.unique(axis.step_signs).tolist() == [-1, 1]
    positions = decoded(store_run / "trace.vcd", "th2")[:, 2]
    np.testing.assert_array_equal(positions, np.cumsum(axis.step_signs[:-1], dtype=np.int64))


def test_a_window_has_its_own_pulses_only(carry_run: Path, tmp_path: Path) -> None:
    trace = tmp_path / "window.vcd"
    window = ["--from", "0.3", "--to", "0.31", "--axis", "th2"]
    assert run(["trace", str(carry_run), *window, "--out", str(trace)]) == 0
    evidence = read_edges(carry_run)
    axis = next(axis for axis in evidence.axes if axis.name == "th2")
    t_s = (axis.step_counts - evidence.start_counts) / 72e6
    inside = (t_s > 0.3) & (t_s <= 0.31)
    assert inside.sum() > 30
    signs = axis.step_signs[inside]
    np.testing.assert_array_equal(decoded(trace, "th2")[:, 2], np.cumsum(signs[:-1], dtype=np.int64))
