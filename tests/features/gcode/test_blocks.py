"""Lines of G-code: every word is understood or refused, with its line."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.features.gcode.blocks import read_blocks, strict_groups
from steptwin.host.common.errors import InputError
from tests.host.complaints import complaint_of

TEXT = """%
N10 G21 g90 (metric; absolute) G17
g1 x 10 Y-.5Z+2. F 600 ; to the first point

N20X.25
M3 S1000 (turns)
G64 P0.05 Q.01
M2
%
"""


def test_words_of_every_form() -> None:
    blocks = read_blocks(TEXT).blocks
    assert [(block.line, dict(block.codes), dict(block.numbers)) for block in blocks] == [
        (2, {"units": "G21", "distances": "G90", "plane": "G17"}, {}),
        (3, {"motion": "G1"}, {"X": 10.0, "Y": -0.5, "Z": 2.0, "F": 600.0}),
        (5, {}, {"X": 0.25}),
        (6, {"spindle": "M3"}, {"S": 1000.0}),
        (7, {"corners": "G64"}, {"P": 0.05, "Q": 0.01}),
        (8, {"stops": "M2"}, {}),
    ]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("G1 X1 X2", "X2: a line has one X word"),
        ("G0 G1 X1", "G1: beside G0; a line has one word for motion"),
        ("G41 D1", "G41 is not understood: there are G0 G1 G2 G3 "),
        ("G81 Z1 R1", "G81 is not understood"),
        ("G95 F1", "G95 is not understood: there are G0 G1 G2 G3 "),
        ("M104 S200", "M104 is not understood without a dialect; it is in klipper, marlin (--dialect, or "),
        ("#1=5", "'#1=5' is not understood: it is neither a word nor a comment"),
        ("G1 X[1+2]", "'X[1+2]' is not understood"),
        ("O100 sub", "O100 is not understood: there are X Y Z"),
        ("G1 U1", "U1 is not understood: there are X Y Z A C I J K R F P Q S L, G and M"),
        ("M6 T1", "M6 is not understood without a dialect; it is in grbl, grblhal, linuxcnc (--dialect, or"),
        ("G1 X", "'X' is not understood"),
        ("G1 X1e3", "E3 is not understood: there are X Y Z"),
        ("G1 (open X1", "'(open X1' is not understood"),
        ("G1 X2000000", "X2000000: a number is at most 1e+06 in size"),
        ("G1 N5 X1", "N5: a line's number is its first word"),
        ("G1 X" + "1" * 300, "has 304 characters; a line has at most 256"),
    ],
)
def test_what_is_not_understood_is_refused_with_line_and_word(line: str, message: str) -> None:
    text = complaint_of(lambda: read_blocks(f"G21\n{line}\n"))
    assert text.startswith(f"line 2: {message}"), text


def test_nothing_stands_behind_the_end() -> None:
    complaint_of(lambda: read_blocks("G0 X1\nM30\nG0 X2"))
    complaint_of(lambda: read_blocks("%\nG0 X1\n%\nG0 X2"))
    complaint_of(lambda: read_blocks("%\n(nothing)\n%"))


@pytest.mark.parametrize(("count", "passes"), [pytest.param(200_000, True, marks=pytest.mark.slow), (200_001, False)])
def test_the_number_of_lines_has_a_bound(count: int, passes: bool) -> None:
    text = "G0 X1" + "\n" * (count - 1)
    if passes:
        assert len(read_blocks(text).blocks) == 1
    else:
        complaint_of(lambda: read_blocks(text))


words = st.dictionaries(st.sampled_from("XYZIJKFS"), st.integers(-99999, 99999), min_size=1)


@pytest.mark.slow
@given(st.lists(words, min_size=1, max_size=5), st.booleans(), st.sampled_from(["", " ", "\t"]))
def test_numbers_come_back_however_they_are_spaced(lines: list[dict[str, int]], lower: bool, space: str) -> None:
    written = [space.join(f"{name}{space}{value / 1000:.3f}" for name, value in line.items()) for line in lines]
    text = "\n".join(written)
    blocks = read_blocks(text.lower() if lower else text).blocks
    assert [dict(block.numbers) for block in blocks] == [
        {name: value / 1000 for name, value in line.items()} for line in lines
    ]


@pytest.mark.slow
@given(st.text(st.characters(codec="utf-8"), max_size=60))
def test_any_text_is_read_whole_or_refused(text: str) -> None:
    """What is read gives each of its words: nothing is skipped but comments, spaces and percent signs."""
    try:
        blocks = read_blocks(text).blocks
    except InputError:
        return
    found = sum(len(block.codes) + len(block.numbers) for block in blocks)
    bare = re.sub(r"\([^()]*\)|;.*", "", text)
    letters = len(re.findall(r"[A-Za-z]", bare)) - len(re.findall(r"(?m)^\s*[Nn]", bare))
    assert found == letters


def test_each_code_belongs_to_one_group() -> None:
    assert {group for code, group in strict_groups().items() if code.startswith("M")} == {
        "stops",
        "spindle",
        "coolant",
        "outputs",
    }
