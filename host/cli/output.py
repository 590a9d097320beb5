"""How commands speak: JSON documents and tables on stdout."""

import json
from typing import Any

import typer

_UNBOUNDED = 10_000


def print_json(document: dict[str, Any]) -> None:
    """One JSON document; the only thing on stdout when --json is given."""
    typer.echo(json.dumps(document, indent=2))


def warn(text: str) -> None:
    """A line on stderr about what is done nevertheless."""
    typer.echo(f"steptwin: warning: {text}", err=True)


def pose_text(pose: dict[str, float]) -> str:
    """The tool's pose in a line."""
    return "tool: x {x_mm:.4f} mm, y {y_mm:.4f} mm, z {z_mm:.4f} mm, {attitude_deg:.4f} deg".format(**pose)


def print_table(columns: list[str], rows: list[list[str]], *, text_columns: int = 1) -> None:
    """A table: the first columns are texts, the others numbers."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
    for i, column in enumerate(columns):
        is_text = i < text_columns
        table.add_column(column, justify="left" if is_text else "right", no_wrap=not is_text, overflow="fold")
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False, markup=False, emoji=False)  # names from a robot's file mean nothing to rich
    if text_columns < len(columns):  # texts may wrap, but a cropped number would be a wrong one
        console.width = max(console.width, Console(width=_UNBOUNDED).measure(table).maximum)
    console.print(table)
