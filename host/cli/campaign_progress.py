"""Show how far a campaign is: runs, rate, failures and the time that is left, on stderr if it is a terminal."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import ProgressColumn, TaskID

    from steptwin.host.campaign import Row

Show = Callable[[Sequence["Row"]], None]


@contextmanager
def campaign_bar(runs: int, before: int) -> Iterator[Show]:
    """Show a bar while the block makes runs, of which some were there before; the block calls back with new rows."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    began_s, made, failed = monotonic(), 0, 0
    columns = (
        TextColumn("campaign"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]} runs/s, {task.fields[failed]} failed, left:"),
        TimeRemainingColumn(),
    )
    with _bar(columns) as bar:
        task = bar.add(runs, before)

        def show(rows: Sequence["Row"]) -> None:
            nonlocal made, failed
            made += len(rows)
            failed += sum(not row.passed for row in rows)
            rate = made / max(monotonic() - began_s, 1e-3)
            bar.update(task, before + made, rate=f"{rate:.1f}", failed=str(failed))

        yield show


@contextmanager
def tries_bar() -> Iterator[Callable[[str], None]]:
    """Show which cause is being shrunk while the block shrinks; the block calls back with it before each run."""
    from rich.progress import SpinnerColumn, TextColumn

    with _bar((SpinnerColumn(), TextColumn("{task.fields[rate]}"))) as bar:
        task = bar.add(None, 0)
        yield lambda text: bar.update(task, 0, rate=text, failed="")


class _Bar:
    """A progress bar of rich with one task, whose texts are `rate` and `failed`."""

    def __init__(self, columns: "Sequence[ProgressColumn]") -> None:
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True, markup=False)
        self.progress = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)

    def add(self, total: int | None, completed: int) -> "TaskID":
        return self.progress.add_task("", total=total, completed=completed, rate="-", failed="0")

    def update(self, task: "TaskID", completed: int, *, rate: str, failed: str) -> None:
        self.progress.update(task, completed=completed, rate=rate, failed=failed)


@contextmanager
def _bar(columns: "Sequence[ProgressColumn]") -> Iterator[_Bar]:
    bar = _Bar(columns)
    with bar.progress:
        yield bar
