"""Print lines, tables and JSON documents. All that a command prints goes through here.

Lines and tables may contain texts from outside, such as names in files and answers of devices: what is not printable
in them is escaped here. JSON escapes by itself.
"""

import json
from typing import Any, Final

import typer

from steptwin.host.common.printable import printable

_UNBOUNDED: Final = 10_000
"""Width of a console in which no table is cropped."""


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


def warn(text: str) -> None:
    """Print a warning on stderr; the command goes on."""
    say(f"steptwin: warning: {text}", err=True)


def pose_text(pose: dict[str, float]) -> str:
    """Return the tool's pose in one line."""
    return "tool: x {x_mm:.4f} mm, y {y_mm:.4f} mm, z {z_mm:.4f} mm, {attitude_deg:.4f} deg".format(**pose)


def print_table(columns: list[str], rows: list[list[str]], *, text_columns: int = 1) -> None:
    """Print a table; the first `text_columns` columns are texts, the others numbers."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
    for i, column in enumerate(columns):
        is_text = i < text_columns
        table.add_column(
            printable(column), justify="left" if is_text else "right", no_wrap=not is_text, overflow="fold"
        )
    for row in rows:
        table.add_row(*map(printable, row))
    console = Console(highlight=False, markup=False, emoji=False)  # brackets in names are text
    if text_columns < len(columns):  # a text may wrap; a cropped number would read as another number
        console.width = max(console.width, Console(width=_UNBOUNDED).measure(table).maximum)
    console.print(table)
