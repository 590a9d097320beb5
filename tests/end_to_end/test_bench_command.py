"""`steptwin bench`: a row for each method, its columns, and bad arguments."""

import json

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal

CARRY = ["bench", "teaching-scara", "carry"]
METHODS = ["kernel", "dda-20k", "dda-40k", "dda-100k", "bresenham", "austin"]
FIELDS = {
    "motion", "method", "steps", "missing", "extra", "error_steps_max", "error_steps_rms", "timing_us_p50",
    "timing_us_p99", "timing_us_max", "jitter_us_rms", "violations", "steps_per_s", "cortex_m3_percent",
}  # fmt: skip


@pytest.mark.slow
def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*CARRY, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert set(document["machine"]) == {"processor", "cores", "python", "kernel"}
    rows = document["rows"]
    assert [row["method"] for row in rows] == METHODS
    for row in rows:
        assert set(row) == FIELDS
        assert row["motion"] == "teaching-scara carry"
        assert (row["steps"], row["missing"], row["extra"], row["violations"]) == (rows[0]["steps"], 0, 0, 0)
    kernel, *others = rows
    for key in ("error_steps_max", "timing_us_p50", "timing_us_p99", "timing_us_max", "jitter_us_rms"):
        assert all(kernel[key] < other[key] for other in others)


@pytest.mark.slow
def test_table(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")  # wide enough for a motion and its method on one line
    assert run(CARRY) == 0
    lines = capsys.readouterr().out.splitlines()
    methods = [line.split()[2] for line in lines if line.startswith("teaching-scara")]
    assert methods[: len(METHODS)] == METHODS  # below is the table of the kernel's cost on a Cortex-M3


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(["lab-skara"], id="robot"),
        pytest.param(["lab-scara", "spirall"], id="job"),
        pytest.param(["lab-scara", "spiral", "carry"], id="too many"),
    ],
)
def test_bad_arguments(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "bench", *arguments)
