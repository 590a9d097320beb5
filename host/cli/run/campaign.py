"""`steptwin campaign FILE|rerun|report`: make many runs with faults on many cores, and tell what failed in silence."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Final

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, naming_options, out_folder, run_folder
from steptwin.host.cli.output import number_of, print_json, print_table, say, say_no_pictures
from steptwin.host.cli.run.verdict_text import EXIT_NOT_VERIFIED
from steptwin.host.cli.run.virtual_run import FinishedRun
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import whole

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from steptwin.host.studies.campaign import Campaign, Results, Row, Summary, Trial
    from steptwin.host.studies.campaign.summary import PassRate


_SEEDS_SHOWN = 5


def print_summary(summary: "Summary") -> None:
    """Print pass rates, worst cases and causes; the verdict last."""
    rows = [
        [what, name, *_rate(rate)]
        for what, rates in (*summary.groups.items(), ("invariants", summary.invariants))
        for name, rate in rates.items()
    ]
    print_table(["", "", "passed", "of", "rate", "95 % interval"], rows, text_columns=2)
    if summary.worst:
        worst = [
            [each.margin, f"{100 * each.left:.1f}", str(each.row.seed), each.row.robot, each.row.scenario]
            for each in summary.worst
        ]
        print_table(["nearest to the limit", "left %", "seed", "robot", "scenario"], worst)
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
    """Show a bar while the block makes runs, some of which were there before; the block calls back with new rows."""
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
    """Show which cause is being shrunk while the block shrinks; the block calls back with it before each run."""
    from rich.progress import SpinnerColumn, TextColumn

    with _bar(SpinnerColumn(), TextColumn("{task.description}", markup=False)) as bar:
        task = bar.add_task("-", total=None)
        yield lambda text: bar.update(task, description=text)


def _bar(*columns: "ProgressColumn") -> "Progress":
    """Return a progress bar on stderr, which shows nothing where that is no terminal."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True, markup=False)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


_RERUN: Final = "rerun"
_REPORT: Final = "report"


@dataclass(frozen=True, slots=True)
class WorkOptions:
    """The options that say how many runs a campaign makes, and who makes them."""

    runs: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Number of runs instead of the file's; more continue a campaign."),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Processes of this computer; by default one for each core."),
    ] = None
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Scheduler of a Dask cluster to run on instead.")
    ] = None


@command("evening.toml --out out/evening", "rerun out/evening 471 --out out/471")
def campaign(
    work: WorkOptions,
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FILE | rerun DIR SEED | report DIR",
            help="A campaign's file (docs/campaigns.md) to run, or to continue where it was interrupted; or a run of a"
            " campaign's folder to make again, by its seed; or the folder to report.",
        ),
    ] = None,
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Folder for the results, or for the run that is made again.")
    ] = None,
    faults: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Scenario for a run that is made again, such as a shrunk one of the report."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make many runs with random motions, faults and settings, and tell which failed in silence, and why.

    The exit code is 1 if any did. Every run is drawn from its seed; rerun makes one again with all files of a run.
    report writes pictures and, for each cause of failures, the smallest scenario that still fails.
    """
    _require_extra()
    match words or []:
        case [action, folder, seed] if action == _RERUN:
            _refuse(work)
            _rerun(Path(folder), _seed(seed), out, faults, as_json=as_json)
        case [action, folder] if action == _REPORT:
            _refuse(work, ("--faults", faults), ("--out", out))
            _report(Path(folder), as_json=as_json)
        case [action, *_] if action in (_RERUN, _REPORT):
            raise InputError(f"{action}: is followed by {'DIR and SEED' if action == _RERUN else 'DIR'}")
        case [file]:
            _refuse(WorkOptions(), ("--faults", faults))
            _run(file, out, work, as_json=as_json)
        case _:
            raise InputError("a campaign's FILE is needed, or rerun DIR SEED, or report DIR")


def _require_extra() -> None:
    if not all(map(find_spec, ("distributed", "pyarrow", "tomlkit"))):
        raise InputError("campaigns are not installed: pip install 'steptwin[campaign]'")


def _seed(text: str) -> int:
    try:
        return whole(text)
    except ValueError:
        raise InputError(f"SEED {text!r}: is not a whole number") from None


def _refuse(work: WorkOptions, *others: tuple[str, str | None]) -> None:
    """Raise InputError if an option is given."""
    named = [(f"--{field.name}", getattr(work, field.name)) for field in fields(work)]
    for option, value in (*named, *others):
        if value is not None:
            raise InputError(f"{option} {value}: has no effect here")


# --- run


def _run(file: str, out: str | None, work: WorkOptions, *, as_json: bool) -> None:
    from steptwin.host.studies.campaign import Results, read_campaign, sources_of_file
    from steptwin.host.studies.campaign.campaign import RUNS_MAX

    sources = sources_of_file(file)
    made, names = read_campaign(sources)
    if work.runs is not None:
        if work.runs > RUNS_MAX:
            raise InputError(f"--runs {work.runs}: is more than {RUNS_MAX}")
        made = replace(made, runs=work.runs)
    if out is None:
        raise InputError("--out DIR is missing: the folder for the results")
    if work.workers is not None and work.scheduler is not None:
        raise InputError(f"--workers {work.workers}: is for this computer, not for {work.scheduler}")
    processes = os.cpu_count() or 1 if work.workers is None else work.workers
    folder = out_folder(out)
    assert folder is not None
    results = Results(folder)
    try:
        with results.writing():
            sources.keep(folder, names)
            _make_runs(made, results, processes, work.scheduler)
    except KeyboardInterrupt:
        there = int(results.done(made.seeds).sum())
        say(f"interrupted: {there} of {made.runs} runs are there; the same command makes the others", err=True)
        raise
    _tell(results, made, folder, as_json=as_json)


def _make_runs(campaign: "Campaign", results: "Results", processes: int, scheduler: str | None) -> None:
    from steptwin.host.studies.campaign import cluster, run_here, run_on

    done = results.done(campaign.seeds)
    missing = (seed for seed, is_done in zip(campaign.seeds, done, strict=True) if not is_done)
    before = int(done.sum())
    if before == campaign.runs:
        return
    if before:
        say(f"{before} of {campaign.runs} runs are there already", err=True)
    with campaign_bar(campaign.runs, before) as show:
        if processes == 1 and scheduler is None:
            for rows in run_here(campaign, missing):
                results.add(rows)
                show(rows)
            return
        with naming_options("scheduler"), cluster(processes, scheduler) as client:
            for rows in run_on(client, campaign, missing):
                results.add(rows)
                show(rows)


def _tell(results: "Results", campaign: "Campaign", folder: Path, *, as_json: bool) -> None:
    """Print what the rows tell; end with exit code 1 if something failed in silence."""
    from steptwin.host.studies.campaign import summarised

    summary = summarised(results.rows(campaign.seeds), campaign.runs)
    if as_json:
        print_json({"folder": str(folder), **summary.to_dict()})
    else:
        print_summary(summary)
        say(f"pictures and smallest scenarios: steptwin campaign report {folder}")
    _end(summary)


def _end(summary: "Summary") -> None:
    if not summary.passed:
        raise typer.Exit(EXIT_NOT_VERIFIED)


# --- rerun and report


def _kept(folder: Path) -> "tuple[Campaign, Results]":
    """Return the campaign of a folder, with as many runs as --runs has made of it, and its results."""
    from steptwin.host.studies.campaign import Results, read_campaign, sources_of_results

    kept, _ = read_campaign(sources_of_results(folder))
    results = Results(folder)
    return replace(kept, runs=max(kept.runs, results.runs_there(kept.first_seed))), results


def _rerun(folder: Path, seed: int, out: str | None, faults: str | None, *, as_json: bool) -> None:
    from steptwin.host.record.folder.run_pictures import draw_here
    from steptwin.host.studies.campaign import draw, perform, read_scenario_table, row_of, with_varied_file

    if out is None:
        raise InputError("--out DIR is missing: the folder for the run's files")
    if Path(out).resolve() == folder.resolve():
        raise InputError(f"--out {out}: is the campaign's own folder: take another one")
    kept, results = _kept(folder)
    trial = with_varied_file(draw(kept, seed))
    if faults is not None:
        trial = trial.with_table(read_scenario_table(faults))
    to = run_folder(out)
    assert to is not None
    performance = perform(trial)
    if performance.outcome is None:
        raise InputError(f"the run of seed {seed} was not made: {performance.message}")
    row = row_of(performance)
    again = FinishedRun.of(performance.outcome, turning=performance.motors is not None)
    again.save(to, draw_here)
    if as_json:
        drawn = {"parameters": dict(row.parameters), "choices": dict(row.choices)}
        print_json(again.document() | {"seed": seed, **drawn, "breaches": [str(each) for each in row.breaches]})
    else:
        again.print()
        say(
            f"drawn for seed {seed}: {_drawn(trial if faults is None else trial.with_table({}))}",
            *(f"FAILED  {breach}" for breach in row.breaches),
            f"report, edges, bus log and waveform are in {to}/",
        )
    stored = results.row(seed)
    if faults is None and stored is not None and stored != row:
        say(f"seed {seed}: the row in {folder} is another one: it was made by another version", err=True)
    if row.breaches:
        raise typer.Exit(EXIT_NOT_VERIFIED)


def _drawn(trial: "Trial") -> str:
    values = trial.parameters.items()
    return ", ".join(f"{name} {f'{value:.7g}' if isinstance(value, float) else value}" for name, value in values)


def _report(folder: Path, *, as_json: bool) -> None:
    from steptwin.host.studies.campaign import write_report

    kept, results = _kept(folder)
    with tries_bar() as tried:
        report = write_report(results, kept, folder, tried)
    if as_json:
        print_json({**report.summary.to_dict(), "files": list(report.files)})
    else:
        print_summary(report.summary)
        say(f"in {folder / 'report'}/: {', '.join(report.files)}")
    if not report.pictures:
        say_no_pictures()
    _end(report.summary)
