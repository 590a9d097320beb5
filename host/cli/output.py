"""Print lines, tables and JSON documents; all output of commands.

Lines and tables may have texts from outside, such as names in files and answers of devices; unprintable characters in
them are escaped here. JSON escapes by itself.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import typer

from steptwin.host.common.bad_input import printable
from steptwin.host.common.extras import installing

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from steptwin.host.client import Progress


GAP: Final = 2
"""Spaces between columns."""

Cells = Sequence[Sequence[str]]
"""Rows of a table with the headings first; the first columns are texts, the others numbers."""


def column_widths(width: int, cells: Cells, text_columns: int) -> list[int]:
    """Return each column's width: that of its cells, or less if the widest texts must wrap."""
    widths = [_widest(column, lambda cell: [cell]) for column in zip(*cells, strict=True)]
    least = _least_widths(cells, text_columns)
    while total_width(widths) > width and widths != least:
        widest = max((i for i in range(text_columns) if widths[i] > least[i]), key=widths.__getitem__)
        widths[widest] -= 1
    return widths


def parts_that_fit(width: int, cells: Cells, text_columns: int) -> list[list[int]]:
    """Return the columns of as few tables as can hold all numbers, each with all text columns.

    A table exceeds `width` only if the longest words of its texts and a single number do.
    """
    least = _least_widths(cells, text_columns)
    texts = list(range(text_columns))
    parts = [texts]
    for i in range(text_columns, len(least)):
        with_it = [*parts[-1], i]
        if total_width([least[column] for column in with_it]) > width and parts[-1] != texts:
            parts.append([*texts, i])
        else:
            parts[-1] = with_it
    return parts


def total_width(widths: list[int]) -> int:
    """Return the width of a table with columns of these widths."""
    return sum(widths) + GAP * (len(widths) - 1)


def _least_widths(cells: Cells, text_columns: int) -> list[int]:
    """Return each column's width with a line for each word of the texts."""
    return [
        _widest(column, str.split if i < text_columns else lambda cell: [cell])
        for i, column in enumerate(zip(*cells, strict=True))
    ]


def _widest(column: Sequence[str], pieces: Callable[[str], list[str]]) -> int:
    from rich.cells import cell_len

    return max((cell_len(piece) for cell in column for piece in pieces(cell)), default=0)


def say(*lines: str, err: bool = False) -> None:
    """Print lines on stdout, or on stderr; line breaks in them are escaped."""
    for line in lines:
        typer.echo(printable(line), err=err)


def print_text(text: str) -> None:
    """Print a text of StepTwin's own, with its line breaks."""
    typer.echo(text, nl=False)


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON document: the whole stdout of a command with --json."""
    typer.echo(json.dumps(document, indent=2))


def say_no_pictures() -> None:
    """Print why there are no pictures, on stderr."""
    say(f"no pictures: matplotlib is not installed ({installing('plot')})", err=True)


def print_json_line(document: dict[str, Any]) -> None:
    """Print one of several JSON documents on a line of its own."""
    typer.echo(json.dumps(document))


def say_compiling() -> None:
    """Print on stderr that the first use compiles, which takes long."""
    say("numba compiles the motion's functions for this computer: once, up to a minute", err=True)


def warn(text: str) -> None:
    """Print a warning on stderr and continue."""
    say(f"steptwin: warning: {text}", err=True)


def pose_text(pose: Mapping[str, Any]) -> str:
    """Return the tool's pose, a document, in one line."""
    return f"tool: {pose_words(pose, 4, 'deg')}"


def pose_words(pose: Mapping[str, Any], decimals: int, attitude: str) -> str:
    """Return a pose, a document, as text with `decimals` decimals; `attitude` names a single angle."""
    words = [f"{axis} {fixed(pose[f'{axis}_mm'], decimals)} mm" for axis in "xyz"]
    if "attitude_deg" in pose:
        words.append(attitude.replace("deg", f"{fixed(pose['attitude_deg'], decimals)} deg"))
    for key, name, unit in (("rpy_deg", "rpy", " deg"), ("direction", "direction", "")):
        if key in pose:
            words.append(f"{name} {' '.join(fixed(value, decimals) for value in pose[key])}{unit}")
    upright = "rpy_deg" in pose and abs(pose["rpy_deg"][1]) >= _LEVEL_DEG
    return ", ".join(words) + (f" ({_UPRIGHT})" if upright else "")


_LEVEL_DEG: Final = 89.999
"""Pitch from which on roll is 0: `LEVEL_DEG` of the rotations, repeated here, since importing that takes numpy."""
_UPRIGHT: Final = "at this pitch roll and yaw are one turn, all of it yaw"


def number_of(count: int, noun: str) -> str:
    """Return a number of things as text, as in `1 run` and `2 runs`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def fixed(value: float, decimals: int = 4) -> str:
    """Return a position with a fixed number of decimals; a rounded 0 has no sign."""
    return f"{value:z.{decimals}f}"


Columns = Mapping[str, str | Callable[[Any], str]]
"""Columns of a table: for each heading a format of the row's item, such as `{0.name}`, or a function of it."""


def cells_of(columns: Columns, items: Iterable[Any]) -> list[list[str]]:
    """Return the row of each item."""
    return [[cell.format(item) if isinstance(cell, str) else cell(item) for cell in columns.values()] for item in items]


def print_rows(columns: Columns, items: Iterable[Any], *, text_columns: int = 1) -> None:
    """Print a table with a row for each item, as `print_table`."""
    print_table(list(columns), cells_of(columns, items), text_columns=text_columns)


def print_table(columns: list[str], rows: list[list[str]], *, text_columns: int = 1) -> None:
    """Print a table; the first `text_columns` columns are texts, the others numbers.

    On a terminal too narrow for all numbers, print several tables with the same texts.
    """
    console = text_console()
    cells = _printable(columns, rows)
    parts = parts_that_fit(console.width, cells, text_columns) if console.is_terminal else [list(range(len(columns)))]
    for number, part in enumerate(parts):
        heading, *body = [[row[i] for i in part] for row in cells]
        table, width = text_table(console.width, heading, body, text_columns=text_columns)
        console.width = max(console.width, width)
        console.print(*[""][:number], table, sep="\n")


def text_console() -> "Console":
    """Return stdout as a rich console that prints texts literally: brackets in names are no markup."""
    from rich.console import Console

    return Console(highlight=False, markup=False, emoji=False)


def text_table(width: int, columns: list[str], rows: list[list[str]], *, text_columns: int) -> "tuple[Table, int]":
    """Return a table and its width, which exceeds `width` only if it cannot be narrower.

    Texts may wrap between words. A number never does, since its parts would read as other numbers.
    """
    from rich import box
    from rich.table import Table

    headings, *body = _printable(columns, rows)
    widths = column_widths(width, [headings, *body], text_columns)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, GAP - 1, 0, 0), show_edge=False)
    for i, (column, cell_width) in enumerate(zip(headings, widths, strict=True)):
        is_text = i < text_columns
        table.add_column(column, width=cell_width, justify="left" if is_text else "right", no_wrap=not is_text)
    for row in body:
        table.add_row(*row)
    return table, total_width(widths)


def _printable(columns: list[str], rows: list[list[str]]) -> list[list[str]]:
    return [list(map(printable, row)) for row in [columns, *rows]]


@contextmanager
def progress_bar(title: str) -> "Iterator[Progress]":
    """Show a bar during the block, if stderr is a terminal; yield a function for the fraction done."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as RichProgress

    console = Console(stderr=True)
    with RichProgress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(escape(printable(title)), total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)
