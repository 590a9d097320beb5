"""Lay out a table of texts and numbers in a terminal's width: texts may wrap between words, numbers never."""

from collections.abc import Callable, Sequence
from typing import Final

GAP: Final = 2
"""Spaces between columns."""

Cells = Sequence[Sequence[str]]
"""The rows of a table, the headings first; its first columns are texts, the others numbers."""


def column_widths(width: int, cells: Cells, text_columns: int) -> list[int]:
    """Return each column's width: that of its cells, less where the widest texts have to wrap."""
    widths = [_widest(column, lambda cell: [cell]) for column in zip(*cells, strict=True)]
    least = _least_widths(cells, text_columns)
    while total_width(widths) > width and widths != least:
        widest = max((i for i in range(text_columns) if widths[i] > least[i]), key=widths.__getitem__)
        widths[widest] -= 1
    return widths


def parts_that_fit(width: int, cells: Cells, text_columns: int) -> list[list[int]]:
    """Return the columns of each of several tables: as few tables as can hold all numbers, each with all texts.

    A table is still wider than `width` if the texts' longest words and a single number are.
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
    """Return each column's width when each word of the texts stands in a line of its own."""
    return [
        _widest(column, str.split if i < text_columns else lambda cell: [cell])
        for i, column in enumerate(zip(*cells, strict=True))
    ]


def _widest(column: Sequence[str], pieces: Callable[[str], list[str]]) -> int:
    from rich.cells import cell_len

    return max((cell_len(piece) for cell in column for piece in pieces(cell)), default=0)
