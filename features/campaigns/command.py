"""`steptwin campaign FILE|rerun|report`: make many runs with faults on many cores, and tell what failed in silence."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, out_folder, run_folder
from steptwin.host.cli.options import argument, given_options, naming_options, option
from steptwin.host.cli.output import Columns, number_of, print_rows, print_table, say, say_no_pictures
from steptwin.host.cli.run.virtual_run import FinishedRun
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.numbers import whole

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from steptwin.features.campaigns.campaign import Campaign
    from steptwin.features.campaigns.results import Results
    from steptwin.features.campaigns.row import Row
    from steptwin.features.campaigns.summary import PassRate, Summary
    from steptwin.features.campaigns.trial import Trial


_SEEDS_SHOWN = 5


def print_summary(summary: "Summary") -> None:
    """Print pass rates, worst cases and causes, and the verdict last."""
    rows = [
        [what, name, *_rate(rate)]
        for what, rates in (*summary.groups.items(), ("invariants", summary.invariants))
        for name, rate in rates.items()
    ]
    print_table(["", "", "passed", "of", "rate", "95 % interval"], rows, text_columns=2)
    if summary.worst:
        print_rows(_WORST, summary.worst)
    if len(summary.versions) > 1:
        say(
            "made by several versions: "
            + ", ".join(f"{name} {number_of(runs, 'run')}" for name, runs in summary.versions.items())
        )
    for reason, runs in summary.refused.items():
        say(f"not made: {number_of(runs, 'run')}: {reason}")
    for name in summary.never_struck:
        runs_met = number_of(summary.struck[name].runs, "run")
        say(f"{name}: its faults never all struck in {runs_met}: it proves nothing")
    for cause in summary.causes:
        more = ", ..." if cause.runs > _SEEDS_SHOWN else ""
        say(f"{number_of(cause.runs, 'run')}: {cause.text}", f"  such as: {cause.example}")
        say(f"  seeds {', '.join(map(str, cause.seeds[:_SEEDS_SHOWN]))}{more}")
    say(_verdict(summary))


_WORST: Final[Columns] = {
    "nearest to the limit": "{0.margin}",
    "left %": lambda each: f"{100 * each.left:.1f}",
    "seed": "{0.row.seed}",
    "robot": "{0.row.robot}",
    "scenario": "{0.row.scenario}",
}


def _rate(rate: "PassRate") -> list[str]:
    lower, upper = rate.interval
    return [f"{rate.passed}", f"{rate.runs}", f"{100 * rate.rate:.2f} %", f"{100 * lower:.2f} .. {100 * upper:.2f} %"]


def _verdict(summary: "Summary") -> str:
    runs = f"{summary.made} of {summary.planned} runs"
    times = f"SIMULATED {summary.simulated_s:.0f} s in {summary.work_s:.0f} s of work"
    if summary.causes:
        failed = summary.all.runs - summary.all.passed
        verdict = f"FAILED: {number_of(failed, 'run')} broke an invariant, {number_of(len(summary.causes), 'cause')}"
    elif summary.never_struck:
        verdict = f"FAILED: {number_of(len(summary.never_struck), 'scenario')} never struck"
    elif not summary.all.runs:
        verdict = "FAILED: no run was made"
    else:
        verdict = "PASSED: nothing failed in silence"
    return f"{runs}, {times}: {verdict}"


Show = Callable[[Sequence["Row"]], None]


@contextmanager
def campaign_bar(runs: int, before: int) -> Iterator[Show]:
    """Show a bar while the block makes runs, `before` of which are done; yield a function for new rows."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    began_s, made, failed = monotonic(), 0, 0
    text = TextColumn("{task.description} failed, left:")
    with _bar(TextColumn("campaign"), BarColumn(), MofNCompleteColumn(), text, TimeRemainingColumn()) as bar:
        task = bar.add_task("- runs/s, 0", total=runs, completed=before)

        def show(rows: Sequence["Row"]) -> None:
            nonlocal made, failed
            made += len(rows)
            failed += sum(not row.passed for row in rows)
            rate = made / max(monotonic() - began_s, 1e-3)
            bar.update(task, completed=before + made, description=f"{rate:.1f} runs/s, {failed}")

        yield show


@contextmanager
def tries_bar() -> Iterator[Callable[[str], None]]:
    """Show the cause whose scenario is being shrunk; yield a function for the cause, called before each run."""
    from rich.progress import SpinnerColumn, TextColumn

    with _bar(SpinnerColumn(), TextColumn("{task.description}", markup=False)) as bar:
        task = bar.add_task("-", total=None)
        yield lambda text: bar.update(task, description=text)


def _bar(*columns: "ProgressColumn") -> "Progress":
    """Return a progress bar on stderr; it is invisible without a terminal."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True, markup=False)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


_RERUN: Final = "rerun"
_REPORT: Final = "report"


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """Options of a campaign: number of runs, workers, and output folder."""

    runs: int | None = option("N", "Number of runs instead of the file's; more continue a campaign.", min=1)
    workers: int | None = option("N", "Processes of this computer; by default one for each core.", min=1)
    scheduler: str | None = option("tcp://HOST:PORT", "Scheduler of a Dask cluster to run on instead.")
    out: str | None = option("DIR", "Folder for the results, or for the run that is made again.")
    faults: str | None = option("FILE", "Scenario for a run that is made again, such as a shrunk one of the report.")

    def refuse_beside(self, *used: str) -> None:
        """Raise InputError if an option is given beside those that are used."""
        for name, value in given_options(self).items():
            if name not in used:
                raise InputError(f"{name} {value}: has no effect here")

    def folder(self, what: str, make: Callable[[str], Path]) -> Path:
        """Create the folder of --out; raise InputError, with its purpose, if it is missing."""
        if self.out is None:
            raise InputError(f"--out DIR is missing: the folder for {what}")
        return make(self.out)


@command("evening.toml --out out/evening", "rerun out/evening 471 --out out/471")
def campaign(
    answer: AnswerOptions,
    asked: CampaignOptions,
    words: list[str] | None = argument(
        "FILE | rerun DIR SEED | report DIR",
        "A campaign's file (docs/faults.md) to run, or to continue where it was interrupted; or a run of a"
        " campaign's folder to make again, by its seed; or the folder to report.",
    ),
) -> None:
    """Make many runs with random motions, faults and settings, and tell which failed in silence, and why.

    The exit code is 1 if any did. Every run is drawn from its seed; rerun makes one again with all files of a run.
    report writes pictures and, for each cause of failures, the smallest scenario that still fails.
    """
    _require_extra()
    match words or []:
        case [action, folder, seed] if action == _RERUN:
            asked.refuse_beside("--out", "--faults")
            _rerun(answer, asked, Path(folder), _seed(seed))
        case [action, folder] if action == _REPORT:
            asked.refuse_beside()
            _report(answer, Path(folder))
        case [action, *_] if action in (_RERUN, _REPORT):
            raise InputError(f"{action}: is followed by {'DIR and SEED' if action == _RERUN else 'DIR'}")
        case [file]:
            asked.refuse_beside("--runs", "--workers", "--scheduler", "--out")
            _run(answer, asked, file)
        case _:
            raise InputError("a campaign's FILE is needed, or rerun DIR SEED, or report DIR")


def _require_extra() -> None:
    if not all(map(find_spec, ("distributed", "pyarrow", "tomlkit"))):
        raise InputError(f"campaigns are not installed: {installing('campaign')}")


def _seed(text: str) -> int:
    try:
        return whole(text)
    except ValueError:
        raise InputError(f"SEED {text!r}: is not a whole number") from None


# --- run


def _run(answer: AnswerOptions, asked: CampaignOptions, file: str) -> None:
    from steptwin.features.campaigns.campaign import RUNS_MAX, read_campaign
    from steptwin.features.campaigns.results import Results
    from steptwin.features.campaigns.sources import sources_of_file
    from steptwin.features.campaigns.summary import summarised

    sources = sources_of_file(file)
    made, names = read_campaign(sources)
    if asked.runs is not None:
        if asked.runs > RUNS_MAX:
            raise InputError(f"--runs {asked.runs}: is more than {RUNS_MAX}")
        made = replace(made, runs=asked.runs)
    if asked.workers is not None and asked.scheduler is not None:
        raise InputError(f"--workers {asked.workers}: is for this computer, not for {asked.scheduler}")
    folder = asked.folder("the results", out_folder)
    processes = os.cpu_count() or 1 if asked.workers is None else asked.workers
    results = Results(folder)
    try:
        with results.writing():
            sources.keep(folder, names)
            _make_runs(made, results, processes, asked.scheduler)
    except KeyboardInterrupt:
        there = int(results.done(made.seeds).sum())
        say(f"interrupted: {there} of {made.runs} runs are there; the same command makes the others", err=True)
        raise
    summary = summarised(results.rows(made.seeds), made.runs)
    answer.tell(
        {"folder": str(folder), **summary.to_dict()},
        lambda: print_summary(summary),
        f"pictures and smallest scenarios: steptwin campaign report {folder}",
    )
    end_unless(summary.passed)


def _make_runs(campaign: "Campaign", results: "Results", processes: int, scheduler: str | None) -> None:
    from steptwin.features.campaigns.workers import cluster, run_here, run_on

    done = results.done(campaign.seeds)
    missing = (seed for seed, is_done in zip(campaign.seeds, done, strict=True) if not is_done)
    before = int(done.sum())
    if before == campaign.runs:
        return
    if before:
        say(f"{before} of {campaign.runs} runs are there already", err=True)
    here = processes == 1 and scheduler is None
    with (
        campaign_bar(campaign.runs, before) as show,
        naming_options("scheduler"),
        nullcontext() if here else cluster(processes, scheduler) as client,
    ):
        for rows in run_here(campaign, missing) if client is None else run_on(client, campaign, missing):
            results.add(rows)
            show(rows)


# --- rerun and report


def _kept(folder: Path) -> "tuple[Campaign, Results]":
    """Return the campaign of a folder, with the number of runs by --runs, and its results."""
    from steptwin.features.campaigns.campaign import read_campaign
    from steptwin.features.campaigns.results import Results
    from steptwin.features.campaigns.sources import sources_of_results

    kept, _ = read_campaign(sources_of_results(folder))
    results = Results(folder)
    return replace(kept, runs=max(kept.runs, results.runs_there(kept.first_seed))), results


def _rerun(answer: AnswerOptions, asked: CampaignOptions, folder: Path, seed: int) -> None:
    from steptwin.features.campaigns.campaign import read_scenario_table
    from steptwin.features.campaigns.running import perform, row_of
    from steptwin.features.campaigns.trial import draw, with_varied_file
    from steptwin.features.motors.run import MotorRunHook

    if asked.out is not None and Path(asked.out).resolve() == folder.resolve():
        raise InputError(f"--out {asked.out}: is the campaign's own folder: take another one")
    kept, results = _kept(folder)
    trial = with_varied_file(draw(kept, seed))
    if asked.faults is not None:
        trial = trial.with_table(read_scenario_table(asked.faults))
    to = asked.folder("the run's files", run_folder)
    performance = perform(trial)
    if performance.outcome is None:
        raise InputError(f"the run of seed {seed} was not made: {performance.message}")
    row = row_of(performance)
    again = FinishedRun.of(performance.outcome, [MotorRunHook(motors=performance.trial.motors)])
    again.save(to)
    drawn = {"parameters": dict(row.parameters), "choices": dict(row.choices)}
    answer.tell(
        again.document() | {"seed": seed, **drawn, "breaches": [str(each) for each in row.breaches]},
        again.print,
        f"drawn for seed {seed}: {_drawn(trial if asked.faults is None else trial.with_table({}))}",
        *(f"FAILED  {breach}" for breach in row.breaches),
        f"report, edges, bus log and waveform are in {to}/",
    )
    stored = results.row(seed)
    if asked.faults is None and stored is not None and stored != row:
        say(f"seed {seed}: the row in {folder} is another one: it was made by another version", err=True)
    end_unless(not row.breaches)


def _drawn(trial: "Trial") -> str:
    values = trial.parameters.items()
    return ", ".join(f"{name} {f'{value:.7g}' if isinstance(value, float) else value}" for name, value in values)


def _report(answer: AnswerOptions, folder: Path) -> None:
    from steptwin.features.campaigns.campaign_report import write_report

    kept, results = _kept(folder)
    with tries_bar() as tried:
        report = write_report(results, kept, folder, tried)
    answer.tell(
        {**report.summary.to_dict(), "files": list(report.files)},
        lambda: print_summary(report.summary),
        f"in {folder / 'report'}/: {', '.join(report.files)}",
    )
    if not report.pictures:
        say_no_pictures()
    end_unless(report.summary.passed)
