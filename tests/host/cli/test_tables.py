"""Tables in narrow terminals: no word and no number is broken, and no line is longer than it has to be."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.cli.output import GAP, column_widths, parts_that_fit, print_table, total_width

WORDS = st.text("abcxyz0123456789.-", min_size=1, max_size=12)
TEXTS = st.lists(WORDS, max_size=4).map(" ".join)


@st.composite
def tables(draw: st.DrawFn) -> tuple[list[list[str]], int]:
    """Draw headings and rows, and the number of text columns."""
    text_columns, numbers = draw(st.integers(1, 4)), draw(st.integers(0, 6))
    row = st.tuples(*[TEXTS] * text_columns, *[WORDS] * numbers).map(list)
    return draw(st.lists(row, min_size=1, max_size=4)), text_columns


@pytest.mark.slow
@given(tables(), st.integers(10, 120))
def test_columns_shrink_no_further_than_to_their_longest_words(table: tuple[list[list[str]], int], width: int) -> None:
    cells, text_columns = table
    widths = column_widths(width, cells, text_columns)
    roomy = column_widths(10_000, cells, text_columns)
    assert roomy == [max(map(len, column)) for column in zip(*cells, strict=True)]
    assert widths[text_columns:] == roomy[text_columns:]
    for i in range(text_columns):
        words = [word for row in cells for word in row[i].split()]
        assert max(map(len, words), default=0) <= widths[i] <= roomy[i]
    if widths != roomy:
        assert total_width(widths) >= width
    if total_width(widths) > width:
        assert widths == column_widths(0, cells, text_columns)


@pytest.mark.slow
@given(tables(), st.integers(10, 120))
def test_parts_hold_every_number_once_and_fit_if_they_can(table: tuple[list[list[str]], int], width: int) -> None:
    cells, text_columns = table
    parts = parts_that_fit(width, cells, text_columns)
    texts = list(range(text_columns))
    assert [i for part in parts for i in part[text_columns:]] == list(range(text_columns, len(cells[0])))
    least = column_widths(0, cells, text_columns)
    for part in parts:
        assert part[:text_columns] == texts
        assert total_width([least[i] for i in part]) <= width or len(part) <= text_columns + 1


ROWS = [["th1 or th2", "-123.4567", "89.0"], ["d3", "1.0", "2.0"]]


def printed(capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    print_table(["axis", "position", "error"], ROWS)
    return [re.sub(r"\x1b\[[0-9;]*m", "", line).split() for line in capsys.readouterr().out.splitlines()]


def test_a_terminal_too_narrow_for_all_numbers_shows_several_tables(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich then takes stdout for a terminal
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", str(len("th1 or") + GAP + len("-123.4567")))
    rule = ["─" * 17]
    assert printed(capsys) == [
        ["axis", "position"], rule, ["th1", "or", "-123.4567"], ["th2"], ["d3", "1.0"], [],
        ["axis", "error"], rule, ["th1", "or", "th2", "89.0"], ["d3", "2.0"],
    ]  # fmt: skip


def test_a_pipe_gets_one_table(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "15")
    assert printed(capsys)[0] == ["axis", "position", "error"]
