"""Print lines, tables and JSON documents. All that a command prints goes through here.

Lines and tables may contain texts from outside, such as names in files and answers of devices: what is not printable
in them is escaped here. JSON escapes by itself.
"""

import json
from typing import TYPE_CHECKING, Any

import typer

from steptwin.host.cli.table_layout import GAP, column_widths, parts_that_fit, total_width
from steptwin.host.common.printable import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def say(*lines: str, err: bool = False) -> None:
    """Print lines on stdout, or on stderr; a line break inside one of them is escaped."""
    for line in lines:
        typer.echo(printable(line), err=err)


def print_text(text: str) -> None:
    """Print a text that StepTwin has made, with its line breaks."""
    typer.echo(text, nl=False)


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON document: all that a command writes to stdout with --json."""
    typer.echo(json.dumps(document, indent=2))


def print_json_line(document: dict[str, Any]) -> None:
    """Print one of several JSON documents, in a line of its own."""
    typer.echo(json.dumps(document))


def warn(text: str) -> None:
    """Print a warning on stderr; the command goes on."""
    say(f"steptwin: warning: {text}", err=True)


def pose_text(pose: dict[str, float]) -> str:
    """Return the tool's pose in one line."""
    x, y, z, attitude = (fixed(pose[key]) for key in ("x_mm", "y_mm", "z_mm", "attitude_deg"))
    return f"tool: x {x} mm, y {y} mm, z {z} mm, {attitude} deg"


def number_of(count: int, noun: str) -> str:
    """Return a number of things in words, as in `1 run` and `2 runs`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def fixed(value: float, decimals: int = 4) -> str:
    """Return a position with a fixed number of decimals; what rounds to 0 has no sign."""
    return f"{value:z.{decimals}f}"


def print_table(columns: list[str], rows: list[list[str]], *, text_columns: int = 1) -> None:
    """Print a table; the first `text_columns` columns are texts, the others numbers.

    On a terminal that is too narrow for all numbers, print several tables with the same texts.
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
    """Return stdout as a rich console that prints texts as they are: brackets in names are no markup."""
    from rich.console import Console

    return Console(highlight=False, markup=False, emoji=False)


def text_table(width: int, columns: list[str], rows: list[list[str]], *, text_columns: int) -> "tuple[Table, int]":
    """Return a table and the number of characters that it needs, which is above `width` only if it cannot be narrower.

    Texts may wrap between words. A number never does: a part of it would read as another number.
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
