"""Print the figures of the operator's panel, each with the limit that it keeps: `python -m steptwin.bench panel`."""

from collections.abc import Iterator
from importlib.util import find_spec
from statistics import median

from rich.console import Console
from rich.table import Table

from steptwin.bench.panel import delays as panel
from steptwin.bench.panel import page_load as panel_page

LATENESS_RATIO_MAX = 1.5
CORES_MAX = 0.25
START_MAX_S = 4.0
GREY_MAX_MS = 500.0


def print_panel(console: Console) -> None:
    """Measure delays, lateness, load and start; print each."""
    delays = panel.measure()
    with_page = find_spec("nicegui") is not None
    if with_page:
        for death, number in panel_page.DEATHS.items():
            delays.append(panel.DelayRow(f"board {death} to a grey page", GREY_MAX_MS, panel_page.measure_grey(number)))
    table = Table(
        *("from, to", "median, ms", "worst, ms", "limit, ms", "within", "trials"),
        title="The operator's panel: delays, desk or page's server and served board as two processes",
    )
    for row in delays:
        figures = (f"{row.median_ms:.0f}", f"{max(row.delays_ms):.0f}", f"{row.limit_ms:g}")
        table.add_row(row.what, *figures, str(row.kept), str(len(row.delays_ms)))
    console.print(table)
    if not with_page:
        console.print("the page is not measured: the extra `panel` is not installed")
        return
    for line in _costs():
        console.print(line)


def _costs() -> Iterator[str]:
    late = panel.measure_lateness()
    yield (
        "99th percentile of the served board's tick lateness while six axes move, medians of"
        f" {len(late.alone_us)} runs: {median(late.watched_us):.0f} us with a panel that a browser shows,"
        f" {median(late.alone_us):.0f} us without: x {late.ratio:.2f} (limit {LATENESS_RATIO_MAX:g})"
    )
    load = panel_page.measure_load()
    yield (
        f"The page's server with {load.viewers} browsers, each with {load.ticks_per_s:.0f} updates a second:"
        f" {load.cores:.0%} of a core (limit {CORES_MAX:.0%})"
    )
    starts = panel_page.measure_starts()
    for command in dict.fromkeys(start.command for start in starts):
        some = [start for start in starts if start.command == command]
        yield (
            f"{command}: the page is there {median(start.page_s for start in some):.1f} s after the command, with"
            f" numbers in it after {median(start.numbers_s for start in some):.1f} s (medians of {len(some)}; limit"
            f" {START_MAX_S:g} s)"
        )
