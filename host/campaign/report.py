"""Write a campaign's report: what it found as JSON, pictures, and the smallest scenario for each cause of failures."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from steptwin.host.campaign.campaign import Campaign
from steptwin.host.campaign.results import Results
from steptwin.host.campaign.running import run_trial
from steptwin.host.campaign.shrinking import shrunk
from steptwin.host.campaign.summary import Cause, Summary, summarised
from steptwin.host.campaign.toml_text import toml_text
from steptwin.host.campaign.trial import draw, placed
from steptwin.host.common.whole_file import whole_file

FOLDER: Final = "report"
_CAUSES_SHRUNK: Final = 12
"""Causes whose scenarios are shrunk, the most frequent first: each takes a minute."""


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """A report on disk: what it says, its files, and whether there are pictures among them."""

    summary: Summary
    files: tuple[str, ...]
    pictures: bool


def write_report(
    results: Results, campaign: Campaign, folder: Path, tried: Callable[[str], None] = lambda _: None
) -> WrittenReport:
    """Write the report of the rows that are there into the folder `report` of a campaign's.

    `tried` is called with the cause before each run by which its scenario is shrunk.

    Raises:
        InputError: a file of rows is damaged.
        OSError: a file cannot be written.
    """
    place = folder / FOLDER
    place.mkdir(exist_ok=True)
    for stale in (*place.glob("*.png"), *place.glob("cause-*.toml")):
        stale.unlink()
    summary = summarised(results.rows(), campaign.runs)
    files = ["report.json"]
    _write(place / files[0], json.dumps(summary.to_dict(), indent=2) + "\n")
    pictures = find_spec("matplotlib") is not None
    if pictures and summary.all.runs:
        from steptwin.host.campaign.pictures import draw_campaign

        title = f"{summary.made:,} simulated runs"
        files += draw_campaign(summary, results.rows(), title, place)
    for number, cause in enumerate(summary.causes[:_CAUSES_SHRUNK], start=1):
        if text := smallest_scenario(campaign, cause, folder, tried):
            files.append(f"cause-{number}.toml")
            _write(place / files[-1], text)
    return WrittenReport(summary, tuple(files), pictures)


def smallest_scenario(campaign: Campaign, cause: Cause, folder: Path, tried: Callable[[str], None]) -> str:
    """Return, as TOML, the smallest scenario found after which the cause's first run still fails alike.

    It is empty if the run fails no more, as after a repair of what it found.
    """
    trial = draw(campaign, cause.seeds[0])
    wanted = _kind(run_trial(trial).breaches)
    if wanted is None:
        return ""

    def fails(table: dict[str, Any]) -> bool:
        tried(f"{cause.text}: {len(table.get('fault', ()))} faults")
        return _kind(run_trial(trial.with_table(table)).breaches) == wanted

    smallest = shrunk(dict(trial.table), fails)
    table = {"name": trial.scenario, "seed": trial.scenario_seed} | placed(smallest, trial.plan())
    head = [
        f"# {cause.text}",
        f"# Runs that failed so: {cause.runs}. The first: {trial.robot_name}, {trial.motion}, seed {trial.seed}.",
        "# It is made again by",
        f"# steptwin campaign rerun {folder} {trial.seed} --out out/run-{trial.seed}",
        "# The same with this smallest scenario found: add --faults and this file's name.",
        *(() if table.get("fault") else ("# It has no fault: the run fails alike without one.",)),
        "",
    ]
    return "\n".join(head) + toml_text(table)


def _kind(breaches: Any) -> tuple[str, str] | None:
    return (breaches[0].invariant, breaches[0].what) if breaches else None


def _write(path: Path, text: str) -> None:
    with whole_file(path) as file:
        file.write(text.encode())
