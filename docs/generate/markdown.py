"""Make the pieces of a page in Markdown."""

from collections.abc import Sequence


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, text_columns: int = 1) -> str:
    """Return a table whose first `text_columns` columns are texts and the others numbers."""
    rule = ["---"] * text_columns + ["--:"] * (len(columns) - text_columns)
    return "\n".join(_line(cells) for cells in (columns, rule, *rows))


def code(text: str) -> str:
    """Return a block of literal text."""
    return f"```\n{text}\n```"


def _line(cells: Sequence[str]) -> str:
    escaped = (cell.replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"
