"""Reports of campaigns: what they count, their files, and the command from a campaign's file to its verdict."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.features.campaigns import workers
from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.campaign_pictures import least_in_bins, over_decades
from steptwin.features.campaigns.row import Breach, Ended, Row
from steptwin.features.campaigns.summary import summarised
from steptwin.host.cli.app import run
from steptwin.host.record.folder.layout import RECORDING
from steptwin.host.record.folder.unfinished import HEADER
from tests.end_to_end.command_line import refusal, run_json
from tests.features.campaigns.campaigns import SMALL
from tests.features.campaigns.test_results import ROW

FAILING = SMALL.replace(
    """[[scenario]]
name = "nothing"
""",
    """[[scenario]]
name = "two"
[[scenario.fault]]
do = "temperature"
temperature_degc = { uniform = [30, 60] }
at_s = 0.05
[[scenario.fault]]
do = "estop"
pressed = true
at_s = { part_of_motion = [0.5, 0.9] }
expect = { motion = "goes-on" }
""",
).replace("record_ms = { choose = [5, 10] }", "record_ms = 10\nmicrosteps = 8")
"""A campaign in which an emergency stop is expected to change nothing, so that some of its runs fail."""


def test_rows_are_counted() -> None:
    passed = replace(ROW, breaches=(), margins={"bus": 0.5})
    rows = [
        *(replace(passed, seed=seed) for seed in range(3)),
        replace(ROW, seed=9),
        replace(ROW, seed=8, robot="lab-scara"),
        replace(passed, seed=10, scenario="other", struck=(0, 1), margins={"bus": 0.25}),
        Row(11, "lab-scara", "m", "s", Ended.REFUSED, "no payload"),
    ]
    summary = summarised(rows, planned=10)
    assert (summary.made, summary.planned, summary.passed) == (7, 10, False)
    assert summary.all == (4, 6)
    assert summary.groups["robots"] == {"lab-scara": (0, 1), "teaching-scara": (4, 5)}
    assert summary.invariants["steps"] == (4, 6)
    assert summary.invariants["power"] == (6, 6)
    assert summary.struck == {"emergency stop": (0, 5), "other": (0, 1)}
    assert summary.never_struck == ("emergency stop", "other")
    (cause,) = summary.causes
    assert (cause.runs, cause.seeds, cause.example) == (2, (8, 9), "steps: lost (th1: 3)")
    assert cause.robots == {"lab-scara": 1, "teaching-scara": 1}
    assert [(worst.margin, worst.left, worst.row.seed) for worst in summary.worst] == [("bus", 0.25, 10)]
    assert summary.refused == {"no payload": 1}
    assert json.loads(json.dumps(summary.to_dict()))["invariants"]["steps"]["passed"] == 4


def test_a_campaign_passes_only_if_every_scenario_struck() -> None:
    struck = replace(ROW, breaches=(), struck=(1, 2))
    assert summarised([struck], 1).passed
    assert not summarised([replace(struck, struck=(1, 0))], 1).passed
    assert summarised([struck, replace(struck, seed=2, struck=(1, 0))], 1).passed
    assert not summarised([Row(1, "", "", "", Ended.REFUSED, "no")], 1).passed
    crashed = Row(2, "", "", "", Ended.CRASHED, "x", breaches=(Breach("program", "x"),))
    assert not summarised([struck, crashed], 2).passed


def test_an_invariant_that_no_run_is_asked_for_has_no_rate() -> None:
    rows = [replace(ROW, breaches=(), asked=asked) for asked in (("steps", "power"), ("power",))]
    assert summarised(rows, 2).invariants == {"steps": (1, 1), "power": (2, 2)}


def test_rows_of_several_versions_are_told_apart() -> None:
    rows = [replace(ROW, seed=seed, version=version) for seed, version in enumerate(("1.0", "1.1", "1.0"))]
    assert summarised(rows, 3).to_dict()["versions"] == {"1.0": 2, "1.1": 1}


def test_the_least_margin_is_found_in_each_bin() -> None:
    values, margin = np.array([1.0, 2.0, 1.0, 2.0]), np.array([0.5, 0.4, 0.3, 0.6])
    places, least = least_in_bins(values, margin)
    assert (places.tolist(), least.tolist()) == ([1.0, 2.0], [0.3, 0.4])
    places, least = least_in_bins(np.linspace(0, 10, 101), np.linspace(1, 0, 101), bins=5)
    assert places.tolist() == [1.0, 3.0, 5.0, 7.0, 9.0]
    assert least == pytest.approx([0.81, 0.61, 0.41, 0.21, 0.0])


def test_values_over_decades_have_a_logarithmic_axis() -> None:
    assert over_decades(np.geomspace(0.002, 0.2, 99))
    assert not over_decades(np.linspace(0.002, 0.2, 99))
    assert not over_decades(np.array([0.0, 0.002, 0.2]))
    assert (over_decades(np.array([1.0, 1.0, 5.0])), over_decades(np.array([1.0, 1.01, 5.0]))) == (True, False)


# --- the command


@pytest.fixture(scope="module")
def evening(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign that was run by the command, in two parts, and reported."""
    folder = tmp_path_factory.mktemp("evening")
    file = folder / "failing.toml"
    file.write_text(FAILING, encoding="utf-8")
    words = ["campaign", str(file), "--out", str(folder / "out"), "--workers", "1"]
    run([*words, "--runs", "2"])
    assert run(words) == 1
    assert run(["campaign", "report", str(folder / "out")]) == 1
    return folder / "out"


@pytest.fixture(scope="module")
def found(evening: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((evening / "report" / "report.json").read_text())
    return document


@pytest.mark.slow
def test_runs_are_made_once_and_continued(
    evening: Path, found: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    again = run_json(
        capsys, "campaign", str(evening.parent / "failing.toml"), "--out", str(evening), "--workers", "1", exit_code=1
    )
    assert (again["runs"], again["planned"], again["passed"]) == (6, 6, False)
    assert {key: again[key] for key in found} == found
    assert len(list((evening / "rows").iterdir())) == 2
    causes = [cause["cause"] for cause in again["causes"]]
    assert all(cause.startswith("answer: EMCY 0x9000 is not documented, after ") for cause in causes)
    assert sum(cause["runs"] for cause in again["causes"]) == 6 - again["rate"]["passed"]


@pytest.mark.slow
def test_the_report_has_pictures_and_the_smallest_scenario(evening: Path) -> None:
    names = {path.name for path in (evening / "report").iterdir()}
    assert {"report.json", "rates.png", "cause-1.toml", "margins-two-fault-1-temperature-degc.png"} <= names
    scenario = tomllib.loads((evening / "report" / "cause-1.toml").read_text())
    (fault,) = scenario["fault"]
    assert set(fault) == {"do", "pressed", "at_s", "expect"}


@pytest.mark.slow
def test_what_was_drawn_is_told_with_the_faults(
    evening: Path, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = tmp_path / "empty.toml"
    empty.write_text("", encoding="utf-8")
    seed = str(found["causes"][0]["seeds"][0])
    words = ["campaign", "rerun", str(evening), seed, "--out", str(tmp_path / "run")]
    assert run(words) == 1
    told = capsys.readouterr().out
    assert "2 of 2 faults struck" in told
    assert f"drawn for seed {seed}: record_ms 10, microsteps 8, random moves.moves 1, " in told
    assert "FAILED  answer: " in told
    assert run([*words, "--faults", str(empty)]) == 0
    assert "FAILED" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_run_is_made_again_with_all_its_files(
    evening: Path, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cause = next(cause for cause in found["causes"] if "board" in cause["cause"])
    words = ["campaign", "rerun", str(evening), str(cause["seeds"][0]), "--out", str(tmp_path / "run")]
    document = run_json(capsys, *words, exit_code=1)
    assert (document["seed"], document["breaches"][0]) == (cause["seeds"][0], cause["example"])
    assert {"edges.npz", "trace.vcd", "report.json", "bus.log"} <= {path.name for path in (tmp_path / "run").iterdir()}
    assert document["parameters"]["microsteps"] == 8
    again = run_json(capsys, "verify", str(tmp_path / "run"), exit_code=3)  # by the folder's robot, as it was varied
    assert again["axes"] == document["axes"]
    smallest = run_json(capsys, *words, "--faults", str(evening / "report" / "cause-1.toml"), exit_code=1)
    assert len(smallest["faults"]) == 1 < len(document["faults"])


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["rerun", "out"],
        ["rerun", "out", "first"],
        ["report", "nowhere"],
        ["report", "out", "--workers", "2"],
        ["none.toml", "--out", "out"],
    ],
)
def test_wrong_words_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "campaign", *words)


@pytest.mark.slow
def test_a_run_that_is_made_again_replaces_no_recording(
    evening: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header = tmp_path / "live" / RECORDING / HEADER
    header.parent.mkdir(parents=True)
    header.touch()
    told = refusal(capsys, "campaign", "rerun", str(evening), "0", "--out", str(tmp_path / "live"))
    assert "the recording of a live board that was interrupted" in told
    assert [path.name for path in (tmp_path / "live").iterdir()] == [RECORDING]


def test_an_interrupted_campaign_says_how_far_it_came(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_campaign: Campaign, seeds: Iterable[int]) -> Iterator[list[Row]]:
        yield [replace(ROW, seed=next(iter(seeds)))]
        raise KeyboardInterrupt

    monkeypatch.setattr(workers, "run_here", interrupted)
    file = tmp_path / "failing.toml"
    file.write_text(FAILING, encoding="utf-8")
    words = ["campaign", str(file), "--out", str(tmp_path / "out"), "--workers", "1"]
    for there in (1, 2):
        assert run(words) == 130
        assert f"interrupted: {there} of 6 runs are there; the same command makes the others" in capsys.readouterr().err


def test_a_folder_is_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "failing.toml"
    file.write_text(FAILING, encoding="utf-8")
    refusal(capsys, "campaign", str(file))
