"""Print `--help`: usage, text, a box each for arguments, groups of options and of commands, examples.

typer has a similar layout, but imports a Markdown parser, a syntax highlighter and more for it, which takes as long as
the rest of `--help`.
"""

from collections.abc import Collection, Iterable, Sequence
from typing import Any, Final

from rich.console import Console, Group
from rich.highlighter import RegexHighlighter
from rich.padding import Padding
from rich.panel import Panel
from rich.table import Table
from rich.text import Text
from rich.theme import Theme
from typer.core import TyperArgument, TyperCommand, TyperGroup

from steptwin.host.common.features import CommandRow

_STYLES: Final = Theme({"option": "bold cyan", "switch": "bold green", "usage": "yellow", "extra": "dim"})


class _Marks(RegexHighlighter):
    """Colours options and switches in texts."""

    highlights = (
        r"(^|\W)(?P<switch>-\w)(?![\w-])",
        r"(^|\W)(?P<option>--[\w-]+)",
        r"(?P<usage>Usage: )",
        r"(?P<extra>\[(default: [^]]*|required)\])$",
    )


_marked: Final = _Marks()


def print_help(
    command: TyperCommand | TyperGroup, context: Any, paragraphs: Sequence[str], table: Collection[CommandRow]
) -> None:
    """Print the help of a command, or of the program with its table of commands; `context` is typer's."""
    console = Console(theme=_STYLES, highlighter=_marked)
    console.print(Padding(_marked(command.get_usage(context)), 1), style="bold")
    first, *others = paragraphs
    texts = [_marked(Text(first)), *(_marked(Text(f"\n{text}", style="dim")) for text in others)]
    console.print(Padding(Group(*texts), (0, 1, 1, 1)))
    shown = [parameter for parameter in command.get_params(context) if not getattr(parameter, "hidden", False)]
    boxes: dict[str, list[Any]] = {"Arguments": [], "Options": []}
    for parameter in shown:
        title = (
            "Arguments"
            if isinstance(parameter, TyperArgument)
            else getattr(parameter, "rich_help_panel", None) or "Options"
        )
        boxes.setdefault(title, []).append(parameter)
    for title, parameters in boxes.items():
        _print_box(console, title, _parameters(parameters, context))
    if table:
        _print_commands(console, table)
    if command.epilog:
        console.print(Padding(_marked(Text(command.epilog)), 1))


def _print_box(console: Console, title: str, table: Table) -> None:
    if table.row_count:
        console.print(Panel(table, title=title, title_align="left", border_style="dim"))


def _table() -> Table:
    return Table(show_header=False, expand=True, box=None, pad_edge=False, padding=(0, 1))


def _parameters(parameters: Iterable[Any], context: Any) -> Table:
    """Return a row for each argument or option: long and short name, placeholder of its value, meaning."""
    table = _table()
    for parameter in parameters:
        record = parameter.get_help_record(context)
        if isinstance(parameter, TyperArgument):
            names = ("", parameter.display_name_raw, "")
        else:
            long = ",".join(name for name in parameter.opts if name.startswith("--"))
            names = (long, ",".join(name for name in parameter.opts if name != long), parameter.metavar or "")
        *marked, word = names
        table.add_row(*map(_marked, marked), Text(word, style="bold yellow"), _marked(record[1] if record else ""))
    return table


def _print_commands(console: Console, commands: Collection[CommandRow]) -> None:
    """Print a box for each group of commands, all with names of the same width."""
    width = max(len(command.name) for command in commands)
    groups: dict[str, list[CommandRow]] = {}
    for command in commands:
        groups.setdefault(command.group, []).append(command)
    for title, rows in groups.items():
        table = _table()
        table.add_column(style="bold cyan", no_wrap=True, width=width)
        table.add_column(ratio=1)
        for row in rows:
            if row.usual:
                table.add_row(row.name, _marked(row.help))
        if others := [row.name for row in rows if not row.usual]:
            table.add_row("", Text(f"also: {', '.join(others)}", style="cyan"))
        _print_box(console, title, table)
