"""Measure speed and timing error as ratios within one run; `python -m steptwin.bench` (`make bench`) prints all."""

from collections.abc import Iterable

from rich.table import Table


def bench_table(title: str, headings: str, rows: Iterable[str]) -> Table:
    """Make a table of headings and rows whose cells are separated by `|`, as in Markdown."""
    table = Table(*headings.split("|"), title=title or None)
    for row in rows:
        table.add_row(*row.split("|"))
    return table
