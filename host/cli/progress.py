"""Show a progress bar on stderr during long work."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from steptwin.host.common.bad_input import printable

if TYPE_CHECKING:
    from steptwin.host.client import Progress


@contextmanager
def progress_bar(title: str) -> "Iterator[Progress]":
    """Show a bar while the block runs, if stderr is a terminal; the block calls back with the part that is done."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as RichProgress

    console = Console(stderr=True)
    with RichProgress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(escape(printable(title)), total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)
