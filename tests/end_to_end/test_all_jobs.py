"""Every job of every robot through the emulated board: net steps, pulses, tool errors, no violation."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end import fingerprints
from tests.end_to_end.marks import slow_but


@dataclass(frozen=True)
class Expected:
    """A run's command, and the figures of the papers' sampled motions: rounded targets, pulses, errors of the tool."""

    command: str
    start: tuple[int, ...]
    end: tuple[int, ...]
    pulses: tuple[int, ...] | None = None
    tool_mm: float | None = None
    sharpest_mm: float = 1.4
    """Factor by which the board's error may exceed the sampled one: it is taken at every edge, with hysteresis."""


RUNS = [
    Expected(
        "lab-scara spiral",
        (12000, -642, 4562, 1584),
        (12752, -1271, 4989, 1544),
        (752, 3747, 4523, 772),
        0.156142,
    ),
    Expected(
        "lab-scara spiral -o elbow=left",
        (12000, 3919, -4562, 672),
        (12752, 3718, -4989, 546),
        (752, 3853, 4523, 752),
    ),
    Expected("lab-scara spiral -o z_law=B", (12000, -642, 4562, 1584), (16725, -1271, 4989, 1544)),
    Expected(
        "warehouse-scara drawer-pull",
        (0, 0, 32000, -712, 3224, 893),
        (16000, 16000, 32000, -1846, 3329, 1510),
        (16000, 16000, 0, 2558, 1437, 803),
    ),
    Expected(
        "warehouse-scara pull-line",
        (0, 0, 32000, 0, 2667, 800),
        (0, 0, 32000, -1846, 3329, 1510),
        (0, 0, 0, 1846, 880, 710),
        0.089622,
    ),
    Expected("warehouse-scara store", (4000, 8000, 48000, -2667, 2667, 0), (16000, 16000, 32000, -712, 3224, 893)),
    Expected("warehouse-scara fetch", (4000, 8000, 32000, -712, 3224, 893), (4000, 8000, 48000, -2667, 2667, 0)),
    # th1, th2 and th4 keep one ratio throughout: whatever the law of time, their errors meet where they do. Of the
    # samples every 15 ms none is there.
    Expected(
        "teaching-scara carry", (0, 0, 0, 0), (-1064, 3064, 0, -1000), (1064, 3064, 0, 1000), 0.051643, sharpest_mm=1.5
    ),
    Expected(
        "teaching-scara carry -o law=quintic -o duration_s=0.99",
        (0, 0, 0, 0),
        (-1064, 3064, 0, -1000),
        (1064, 3064, 0, 1000),
    ),
    Expected("teaching-scara carry -o depth_mm=20 -o repetitions=2", (0, 0, 0, 0), (-1064, 3064, 0, -1000)),
    Expected("calibration-scara demo", (0, 0, 0, 0), (2667, -2000, 16000, 1600), (2667, 2000, 16000, 1600), 0.167033),
    Expected("hybrid-arm five-points", (855, -10141, -18716, -171), (1382, 18648, 12884, -276)),
    Expected(
        "hybrid-arm helix",
        (855, -10141, -18716, -171),
        (855, 28259, 19684, -171),
        (8624, 90376, 122432, 1728),
        0.085095,
    ),
]


STORED = {"warehouse-scara store": "stored_run", "teaching-scara carry": "carry_run"}
"""Jobs whose folders other tests need too: the fixtures that run them."""
REPLAYED = {"warehouse-scara pull-line", "calibration-scara demo", "hybrid-arm five-points"}
"""Jobs whose replay takes little time; `python -m tests.end_to_end.fingerprints --replay` replays all."""

CHEAP = [each for each in RUNS if each.command.startswith("teaching-scara carry") and "repetitions" not in each.command]


@pytest.fixture
def folder(expected: Expected, tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Return the folder of a run of the command."""
    if expected.command in STORED:
        stored: Path = request.getfixturevalue(STORED[expected.command])
        return stored
    assert run(["run", *expected.command.split(), "--out", str(tmp_path / "run")]) == 0
    return tmp_path / "run"


@pytest.mark.slow
@pytest.mark.parametrize("expected", slow_but(CHEAP, RUNS), ids=lambda expected: expected.command)
def test_job(expected: Expected, folder: Path, tmp_path: Path) -> None:
    """The figures are those of the papers' motions, and every edge and frame is the same byte as before.

    They are the same again when the folder's bus log is replayed.
    """
    report = json.loads((folder / "report.json").read_text())
    assert report["passed"] is True
    axes = report["axes"]
    for axis, start, end in zip(axes, expected.start, expected.end, strict=True):
        assert abs(axis["steps_start"] - start) <= 1
        assert abs(axis["steps_end"] - end) <= 1
        assert axis["violations"] == 0
        assert axis["unmatched_steps"] == 0
    if expected.pulses is not None:
        for axis, pulses in zip(axes, expected.pulses, strict=True):
            assert abs(axis["pulses"] - pulses) <= 2 * axis["reversals"]
    if expected.tool_mm is not None:
        assert report["tool"]["position_error_mm_max"] <= expected.sharpest_mm * expected.tool_mm
    hashes = fingerprints.stored()[expected.command]
    for name in fingerprints.INTEGERS:
        assert fingerprints.fingerprint(folder, name) == hashes[name], name
    for output in report["outputs"]:
        assert output["from_s"] <= output["changed_s"] <= output["until_s"]
    if expected.command in REPLAYED:
        assert run(["replay", str(folder), "--out", str(tmp_path / "replay")]) == 0
        for name in fingerprints.INTEGERS:
            assert fingerprints.fingerprint(tmp_path / "replay", name) == hashes[name], name
