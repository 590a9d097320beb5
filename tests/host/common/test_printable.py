"""What is printed is one line of printable characters, whatever it holds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.bad_input import printable


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("warehouse-scara pull-line: PASSED", "warehouse-scara pull-line: PASSED"),
        ("Größe 直 θ₁ [bold]", "Größe 直 θ₁ [bold]"),
        ("\x1b[2J\x07", r"\x1b[2J\x07"),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x7f\x80\x9b31m", r"\x7f\x80\x9b31m"),
        ("\u202egnp.exe\u2066\u200b\ufeff", r"\u202egnp.exe\u2066\u200b\ufeff"),
        ("\u2028\u2029\u00a0", r"\u2028\u2029\xa0"),
        ("\ud800\udcff", r"\ud800\udcff"),
        ("\U000e0041", r"\U000e0041"),
    ],
)
def test_what_cannot_be_printed_is_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text(st.characters()))
def test_any_text_becomes_one_printable_line(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    assert len(shown.splitlines()) <= 1
    shown.encode("utf-8")
    assert printable(shown) == shown
