"""What each dialect does with each word, and how it reads lines."""

import pytest

from steptwin.features.gcode.blocks import REFUSALS_MAX, GcodeFile, read_blocks
from steptwin.features.gcode.dialects import WORDS, Dialect
from steptwin.host.common.errors import InputError
from tests.host.complaints import complaint_of

K, M, G, H, L = Dialect

TREATED = {
    "G0 G1 G2 G3": "AAAAAA",
    "G5": "RRARAA",
    "G5.1": "RRRRAA",
    "G5.2 G5.3 G6.2 G6.3": "RRRRRR",
    "G80": "AIIAAA",
    "G17 G18 G19": "AAAAAA",
    "G20": "ARAAAA",
    "G21": "AAAAAA",
    "G90 G91": "AAAAAA",
    "G90.1": "ARRRRA",
    "G91.1": "AIIAAA",
    "G93": "ARRAAA",
    "G94": "AIIAAA",
    "G95": "RRRRRR",
    "G40": "AIIAAA",
    "G41 G42": "RRRRRR",
    "G43": "RRRRII",
    "G43.1": "ARRAAA",
    "G43.2": "RRRRRR",
    "G49": "AIIAAA",
    "G54": "AIAAAA",
    "G55 G56 G57 G58 G59": "ARAAAA",
    "G59.1 G59.2 G59.3": "ARARAA",
    "G61": "ARRIIA",
    "G61.1": "ARRRAA",
    "G64": "ARRRAA",
    "G60": "RRRRRR",
    "G4": "AAAAAA",
    "G10": "AIIAAA",
    "G11": "RIIRRR",
    "G28": "AAAAAA",
    "G30": "RRRAAA",
    "G28.1 G30.1": "RRRAAA",
    "G52": "ARARRA",
    "G53": "ARAAAA",
    "G92": "AAAAAA",
    "G92.1": "ARAAAA",
    "G92.2 G92.3": "ARRRAA",
    "G8 G96 G97": "RRRRII",
    "G7 G50 G51": "RRRRRR",
    "G98 G99": "RRRRAA",
    "G12 G27 G29 G31 G32 G34": "RIIRRR",
    "G26 G35 G42 G425": "RRRRRR",
    "G33 G76": "RRRRRR",
    "G38 G38.2 G38.3 G38.4 G38.5": "RRRRRR",
    "G73 G81 G82 G83 G85 G89": "RRRRAA",
    "G84 G86 G88": "RRRRRR",
    "M0 M1": "AAAAAA",
    "M2 M30": "AIIAAA",
    "M60": "RIIRAA",
    "M25 M226 M400": "RAARRR",
    "M3 M4 M5": "AAAAAA",
    "M7 M8 M9": "AAAAAA",
    "M62 M63 M64 M65": "AIIRAA",
    "M66": "RIIRRR",
    "M67 M68": "RIIRII",
    "M6": "RIIIII",
    "M19 M61": "RIIRII",
    "M48": "RIRRII",
    "M49 M50 M51 M52 M53": "RIIRII",
    "M56": "RIIIII",
    "M70 M71 M72": "RIIRRR",
    "M73": "RIIRRR",
    "M98 M99": "RIRRRR",
    "M17": "RIIRRR",
    "M18 M84": "RIIRRR",
    "M82 M83 M104 M105 M106 M107 M109 M110 M114 M117 M118 M119 M140 M190 M204 M221": "RIIRRR",
    "M220": "RAARRR",
    "M92": "RIRRRR",
    "M206 M218 M290 M428 M665 M666 M851 M852": "RIRRRR",
    "M350 M351": "RIRRRR",
    "M410 M605 M808": "RIRRRR",
    "M112 M999": "RRRRRR",
    "M125 M401 M402 M600 M601 M701 M702": "RIIRRR",
    "M486 M862.3 M900": "RIIRRR",
    "G150": "RRRRRR",
}
"""Words that are applied, ignored or refused: without a dialect, then in Klipper, Marlin, grbl, grblHAL, LinuxCNC."""

BESIDE = {"G4": "P1", "G92": "X0", "G52": "X0", "M92": "X80", "M62": "P1", "M63": "P1", "M64": "P1", "M65": "P1"}


@pytest.mark.parametrize("codes", TREATED)
def test_each_word_in_each_dialect(codes: str) -> None:
    for code in codes.split():
        line = f"{code} {BESIDE.get(code, '')}"
        assert "".join(treated(code, line, dialect) for dialect in (None, *Dialect)) == TREATED[codes], code


def treated(code: str, line: str, dialect: Dialect | None) -> str:
    try:
        found = read_blocks(f"G4 P1\n{line}", dialect)
    except InputError as error:
        return "R" if error.messages[0].startswith(f"line 2: {code}") else str(error)
    return "I" if code in found.ignored else "A" if code in found.blocks[-1].codes.values() else "?"


def test_the_list_above_has_each_word_of_the_table() -> None:
    listed = {code for codes in TREATED for code in codes.split()}
    assert {code for word in WORDS for code in word.codes.split()} <= listed


PRINT = """; made by hand
M104 S210 ; heat
START_PRINT BED=60
G28
M83
T0
G92 E0
G1 X10 Y10 E.5 F3000
G1 E-2
M117 Layer (1; of 2
G1 X20 E1.25
EXCLUDE_OBJECT_START NAME='a b'
END_PRINT
M84
"""


def test_a_print_for_klipper() -> None:
    found = read_blocks(PRINT, K)
    assert [(block.line, *block.codes.values(), dict(block.numbers)) for block in found.blocks] == [
        (4, "G28", {}),
        (8, "G1", {"X": 10.0, "Y": 10.0, "F": 3000.0}),
        (9, "G1", {}),
        (11, "G1", {"X": 20.0}),
    ]
    assert found.remarks() == (
        "ignored: E 4 times, END_PRINT 1 time, EXCLUDE_OBJECT_START 1 time, M104 1 time, M117 1 time, M83 1 time,"
        " M84 1 time, START_PRINT 1 time, T0 1 time",
        "START_PRINT, END_PRINT: may move the machine; its moves are not in the file",
    )


def test_a_part_for_linuxcnc() -> None:
    text = "%\nG21 G90 G43 H1 Z5\nT2 M6\nG98 G0 X1\nT3 M6\nM3 S100\nG97 S50 X2\nM8\n%\nnot read"
    found = read_blocks(text, L, outputs=("M8",))
    assert [dict(block.codes) for block in found.blocks] == [
        {"units": "G21", "distances": "G90"},
        {"retraction": "G98", "motion": "G0"},
        {"stops": "M6"},
        {},
        {},
        {"coolant": "M8"},
    ]
    assert found.ignored == {"G43": 1, "M6": 1, "T": 2, "M3": 1, "G97": 1}
    assert found.notes == (
        "G43: the tool's length is not known, and taken as 0",
        "M6: the machine stops for another tool, whose length is not known",
    )


@pytest.mark.parametrize(
    ("dialect", "text", "message"),
    [
        (K, "G1 X1 G90", "line 1: G90: beside G1; Klipper executes one command a line"),
        (M, "X1 Y2", "line 1: 'X1 Y2' is not understood: a line of Marlin begins with a command"),
        (K, "G01 X1", "line 1: G01: Klipper does not know it; write G1"),
        (K, "G1 X", "line 1: X: beside G1; a number is missing"),
        (K, "G1 A5", "line 1: A5 is not understood: G1 takes X Y Z F I J K R P Q S E"),
        (K, "G10 L2 P1 X1", "line 1: G10: Klipper retracts the filament; an origin is not set"),
        (K, "MY_MACRO A=1", "line 1: MY_MACRO: is a macro, which may move the machine; list it in `ignore`"),
        (M, "START_PRINT", "line 1: START_PRINT: is a macro of Klipper: --dialect klipper, or list it in `ignore`"),
        (M, "M92 X80", "line 1: M92: it changes the steps for each mm"),
        (G, "$J=X1", "line 1: '$J=X1' is not understood: there are $H and $X, in grbl"),
        (G, "M84", "line 1: M84: grbl does not know it; it is a word of klipper, marlin"),
        (L, "M84", "line 1: M84: LinuxCNC does not know it; it is a word of klipper, marlin"),
        (G, "G150", "line 1: G150: grbl does not know it"),
        (L, "M67 X1 E0 Q1\nH1", "line 2: H1: no word of the line takes it"),
        (L, "/G1 X1", "line 1: '/G1 X1' is not understood: it is neither a word nor a comment"),
        (None, "N1 G1 X1*99", "line 1: *99: the checksum of the line is "),
        (L, "G1 X1 (open", "line 1: '(open' is not understood"),
        (G, "M30\nG0 X1", "line 2: 'G0 X1' is behind the program's end in line 1"),
    ],
)
def test_what_a_dialect_refuses(dialect: Dialect | None, text: str, message: str) -> None:
    told = complaint_of(lambda: read_blocks(text, dialect))
    assert told.startswith(message), told


@pytest.mark.parametrize(
    ("dialect", "text", "blocks", "ignored"),
    [
        (M, "M92 E415\nG28 X W", [{"X": 0.0}], {"M92": 1}),
        (M, "N3 G1 X5*102\nN4 M110", [{"X": 5.0}], {"M110": 1}),
        (None, "N3 G1 X5*102 ; right", [{"X": 5.0}], {}),
        (K, "G92\ng1 x1.5y2 (told) F60", [{"X": 0.0, "Y": 0.0, "Z": 0.0}, {"X": 1.5, "Y": 2.0, "F": 60.0}], {}),
        (M, "G92\nG4", [{"P": 0.0}], {}),
        (K, "T0\nT0\nT1\nG4", [{}, {"P": 0.0}], {"T0": 2}),
        (G, "$X\n$H\nG1 X1 (open", [{}, {"X": 1.0}], {"$X": 1}),
        (G, "%\nG0 X1\n%\nX2\nM30\nM2\n%", [{"X": 1.0}, {"X": 2.0}, {}], {}),
        (H, "G0 G80 X1\nG80 G1 X2", [{"X": 1.0}, {"X": 2.0}], {}),
        (None, "G0 X1\x1a", [{"X": 1.0}], {}),
        (L, "G0 X1\r\n(grün)\r\n", [{"X": 1.0}], {}),
        (L, "G0 X1 ; " + 300 * "-", [{"X": 1.0}], {}),
    ],
)
def test_lines_of_other_forms(
    dialect: Dialect | None, text: str, blocks: list[dict[str, float]], ignored: dict[str, int]
) -> None:
    found = read_blocks(text, dialect)
    assert [dict(block.numbers) for block in found.blocks] == blocks
    assert found.ignored == ignored


def test_ignored_by_name() -> None:
    def ignoring(dialect: Dialect | None, text: str, *words: str) -> GcodeFile:
        return read_blocks(f"{text}\nG4 P1", dialect, words)

    assert ignoring(K, "MY_MACRO A=1", "my_macro").ignored == {"MY_MACRO": 1}
    assert read_blocks("G61 G0 X1", G).remarks() == ("ignored: G61 1 time",)
    assert ignoring(M, "START_PRINT", "START_PRINT").ignored == {"START_PRINT": 1}
    assert ignoring(M, "M206 Z1", "M206").ignored == {"M206": 1}
    assert ignoring(None, "M104", "M104").ignored == {"M104": 1}
    cycle = ignoring(L, "G81 X1 Z-1 R2", "G81")  # with its whole line
    assert cycle.ignored == {"G81": 1}
    assert len(cycle.blocks) == 1


@pytest.mark.parametrize(("wrong", "told"), [(REFUSALS_MAX - 1, 19), (REFUSALS_MAX, 20), (REFUSALS_MAX + 1, 20)])
def test_the_first_twenty_refusals_are_told_at_once(wrong: int, told: int) -> None:
    with pytest.raises(InputError) as caught:
        read_blocks("G0 X1\n" + "G41 D1\n" * wrong, L)
    assert len(caught.value.messages) == told
    assert caught.value.messages[-1].startswith(f"line {told + 1}: G41: ")
