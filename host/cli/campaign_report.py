"""Print what a campaign has found."""

from typing import TYPE_CHECKING

from steptwin.host.cli.output import number_of, print_table, say

if TYPE_CHECKING:
    from steptwin.host.campaign import Summary
    from steptwin.host.campaign.statistics import PassRate

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
