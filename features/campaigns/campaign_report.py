"""Write a campaign's report: results as JSON, pictures, and the smallest scenario for each cause of failures."""

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from importlib.util import find_spec
from math import floor, log10, trunc
from pathlib import Path
from typing import Any, Final

from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.results import Results
from steptwin.features.campaigns.running import run_trial
from steptwin.features.campaigns.summary import Cause, Summary, summarised
from steptwin.features.campaigns.trial import draw
from steptwin.features.campaigns.values import AtPart, PlannedAt, placed
from steptwin.host.common.own_files import made_folder
from steptwin.host.common.whole_file import write_whole

Fails = Callable[[dict[str, Any]], bool]
"""Runs a scenario's table in place of the drawn one; returns True if it fails as before."""

TRIES: Final = 80
"""Largest number of runs to shrink a scenario."""
_FAULTS: Final = "fault"


def shrunk(table: dict[str, Any], fails: Fails, tries: int = TRIES) -> dict[str, Any]:
    """Return the smallest table found that still fails: fewer faults, then fewer keys, then simpler numbers.

    Each simplification that still fails is kept, and all are tried again until none fails (delta debugging; A. Zeller
    and R. Hildebrandt, IEEE Trans. Software Eng. 28, 2002). No table is run twice. The table itself must fail.
    """
    best, tried = deepcopy(table), dict[str, bool]()
    simpler = _simpler(best)
    while (candidate := next(simpler, None)) is not None:
        key = repr(candidate)
        if key not in tried:
            if len(tried) == tries:
                break
            tried[key] = fails(candidate)
        if tried[key]:
            best, simpler = candidate, _simpler(candidate)
    return best


def _simpler(table: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield tables with one simplification, the largest ones first."""
    faults = table.get(_FAULTS, [])
    half = len(faults) // 2
    if half > 1:
        yield {**table, _FAULTS: faults[:half]}
        yield {**table, _FAULTS: faults[half:]}
    for number in range(len(faults)):
        yield {**table, _FAULTS: faults[:number] + faults[number + 1 :]}
    for number, fault in enumerate(faults):
        for key in fault:
            without = {name: value for name, value in fault.items() if name != key}
            yield {**table, _FAULTS: [*faults[:number], without, *faults[number + 1 :]]}
    for number, fault in enumerate(faults):
        for simpler in _simpler_numbers(fault):
            yield {**table, _FAULTS: [*faults[:number], simpler, *faults[number + 1 :]]}


def _simpler_numbers(value: Any) -> Iterator[Any]:
    """Yield a value with one of its numbers simpler: nearer to 0, or with fewer digits."""
    if isinstance(value, dict):
        for key, item in value.items():
            for simpler in _simpler_numbers(item):
                yield {**value, key: simpler}
    elif isinstance(value, list):
        for number, item in enumerate(value):
            for simpler in _simpler_numbers(item):
                yield [*value[:number], simpler, *value[number + 1 :]]
    elif isinstance(value, AtPart | PlannedAt):
        yield from (type(value)(part) for part in _simpler_numbers(value.part))
    elif isinstance(value, int | float) and not isinstance(value, bool) and value:
        yield from _weaker(value)


def _weaker(value: float) -> Iterator[float]:
    """Yield numbers nearer to 0 or with fewer digits than a number other than 0."""
    for digits in (1, 2):
        parts = 10.0 ** (floor(log10(abs(value))) - digits + 1)
        shorter = float(f"{trunc(value / parts) * parts:.6g}")
        if 0 < abs(shorter) < abs(value):
            yield int(shorter) if isinstance(value, int) else shorter
    if isinstance(value, int):
        yield int(value / 2)
    elif abs(value) > _LEAST:
        yield float(f"{value / 2:.1g}")


_LEAST: Final = 1e-3
"""Smallest number that is halved: an instant of 1 ms is early enough."""


FOLDER: Final = "report"
_CAUSES_SHRUNK: Final = 12
"""Largest number of causes whose scenarios are shrunk, the most frequent first; each takes a minute."""


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """A report on disk: its content, its files, and whether it has pictures."""

    summary: Summary
    files: tuple[str, ...]
    pictures: bool


def write_report(
    results: Results, campaign: Campaign, folder: Path, tried: Callable[[str], None] = lambda _: None
) -> WrittenReport:
    """Write the report of the existing rows into the folder `report` of a campaign.

    `tried` is called with the cause before each run that shrinks its scenario.

    Raises:
        InputError: a file of rows is damaged.
        OSError: a file cannot be written.
    """
    place = folder / FOLDER
    made_folder(place)
    for stale in (*place.glob("*.png"), *place.glob("cause-*.toml")):
        stale.unlink()
    summary = summarised(results.rows(campaign.seeds), campaign.runs)
    files = ["report.json"]
    write_whole(place / files[0], json.dumps(summary.to_dict(), indent=2) + "\n")
    pictures = find_spec("matplotlib") is not None
    if pictures and summary.all.runs:
        from steptwin.features.campaigns.campaign_pictures import draw_campaign

        title = f"{summary.made:,} simulated runs"
        files += draw_campaign(summary, lambda: results.rows(campaign.seeds), title, place)
    for number, cause in enumerate(summary.causes[:_CAUSES_SHRUNK], start=1):
        if text := smallest_scenario(campaign, cause, folder, tried):
            files.append(f"cause-{number}.toml")
            write_whole(place / files[-1], text)
    return WrittenReport(summary, tuple(files), pictures)


def smallest_scenario(campaign: Campaign, cause: Cause, folder: Path, tried: Callable[[str], None]) -> str:
    """Return, as TOML, the smallest scenario that makes the cause's first run fail alike.

    The text is empty if the run does not fail any more, as after a repair.
    """
    import tomlkit

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
        f"# Runs that failed so: {cause.runs}. The first: {trial.robot_name}, {trial.motion_name}, seed {trial.seed}.",
        "# It is made again by",
        f"# steptwin campaign rerun {folder} {trial.seed} --out out/run-{trial.seed}",
        "# The same with this smallest scenario found: add --faults and this file's name.",
        *(() if table.get("fault") else ("# It has no fault: the run fails alike without one.",)),
        "",
    ]
    return "\n".join(head) + tomlkit.dumps(table)


def _kind(breaches: Any) -> tuple[str, str] | None:
    return (breaches[0].invariant, breaches[0].what) if breaches else None
