"""Read a text of G-code into blocks of words; what is not understood is refused with its line and word.

The words are those of RS274/NGC (T. Kramer, F. Proctor, E. Messina, "The NIST RS274NGC Interpreter, Version 3", NIST
IR 6556, 2000) that make sense for a tool path of an arm. No word is skipped: what a machine does not do would be seen
in the part only.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from steptwin.host.common.bad_input import prefixed, printable, shortened
from steptwin.host.common.errors import InputError

LINES_MAX: Final = 200_000
"""Lines of a file: ten times those of a large part."""
LINE_CHARS_MAX: Final = 256
"""Characters of a line, as in RS274/NGC."""
VALUE_MAX: Final = 1e6
"""Size of a number: a kilometre, or a feed of a thousand metres a minute."""

_WORD: Final = re.compile(r"([A-Za-z])[ \t]*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))|\(([^()]*)\)")
_SPACE: Final = re.compile(r"[ \t\r]*")

GROUPS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("G0", "G1", "G2", "G3", "G80"), "motion"),
    "G17": "plane",
    **dict.fromkeys(("G20", "G21"), "units"),
    **dict.fromkeys(("G90", "G91"), "distances"),
    **dict.fromkeys(("G90.1", "G91.1"), "centres of arcs"),
    "G94": "feed",
    "G40": "radius of the tool",
    "G49": "length of the tool",
    "G54": "coordinates",
    **dict.fromkeys(("G61", "G64"), "corners"),
    **dict.fromkeys(("G4", "G28"), "single actions"),
    **dict.fromkeys(("M0", "M1", "M2", "M30"), "stops"),
    **dict.fromkeys(("M3", "M4", "M5"), "spindle"),
    **dict.fromkeys(("M7", "M8", "M9"), "coolant"),
    **dict.fromkeys(("M62", "M63", "M64", "M65"), "outputs"),
}
"""The G and M words that are understood, each with its modal group, of which a line has one word."""

NUMBERS: Final = ("X", "Y", "Z", "A", "C", "I", "J", "K", "R", "F", "P", "Q", "S")
"""The other words that are understood; N is a line's number, which says nothing."""


@dataclass(frozen=True, slots=True)
class GcodeBlock:
    """A line of G-code.

    Attributes:
        line: number of the line in its file, from 1 on.
        codes: the G or M word of each modal group, such as `G1` by `motion`.
        numbers: the other words, by their letters.
    """

    line: int
    codes: Mapping[str, str]
    numbers: Mapping[str, float]


def read_blocks(text: str) -> tuple[GcodeBlock, ...]:
    """Return the blocks of a text that have words, in order.

    Raises InputError, with line and word, for the first that is not understood or stands behind the program's end.
    """
    lines = text.split("\n")
    if len(lines) > LINES_MAX:
        raise InputError(f"has {len(lines)} lines; at most {LINES_MAX} are read")
    blocks: list[GcodeBlock] = []
    percents, ended = 0, 0
    for number, line in enumerate(lines, 1):
        with prefixed(f"line {number}: "):
            words = line.split(";", 1)[0] if "(" not in line else line
            if words.strip() == "%":
                percents += 1
                ended = ended or (number if percents > 1 or blocks else 0)
                continue
            block = _block(number, line)
            if not block.codes and not block.numbers:
                continue
            if ended:
                raise InputError(f"{line.strip()[:20]!r} is behind the program's end in line {ended}")
            blocks.append(block)
            if block.codes.get("stops") in ("M2", "M30"):
                ended = number
    if not blocks:
        raise InputError("has no words of G-code")
    return tuple(blocks)


def _block(number: int, line: str) -> GcodeBlock:
    if len(line) > LINE_CHARS_MAX:
        raise InputError(f"has {len(line)} characters; a line has at most {LINE_CHARS_MAX}")
    codes, numbers, seen_n = dict[str, str](), dict[str, float](), False
    for letter, digits in _words(line):
        value = float(digits)
        if not abs(value) <= VALUE_MAX:
            raise InputError(f"{letter}{shortened(digits)}: a number is at most {VALUE_MAX:g} in size")
        if letter in ("G", "M"):
            _add_code(codes, letter, value)
        elif letter == "N":
            if seen_n or codes or numbers:
                raise InputError(f"N{shortened(digits)}: a line's number is its first word")
            seen_n = True
        elif letter not in NUMBERS:
            raise InputError(f"{letter}{shortened(digits)} is not understood: there are {' '.join(NUMBERS)}, G and M")
        elif letter in numbers:
            raise InputError(f"{letter}{shortened(digits)}: a line has one {letter} word")
        else:
            numbers[letter] = value
    return GcodeBlock(number, codes, numbers)


def _words(line: str) -> Iterator[tuple[str, str]]:
    """Yield letter and digits of each word of a line; raise InputError for what is neither a word nor a comment."""
    at = _after_space(line, 0)
    while at < len(line) and line[at] != ";":
        found = _WORD.match(line, at)
        if found is None:
            raise InputError(f"{printable(line[at : at + 12])!r} is not understood: it is neither a word nor a comment")
        if found[1]:
            yield found[1].upper(), found[2]
        at = _after_space(line, found.end())


def _after_space(line: str, at: int) -> int:
    found = _SPACE.match(line, at)
    return found.end() if found else at


def _add_code(codes: dict[str, str], letter: str, value: float) -> None:
    code = f"{letter}{value:g}"
    group = GROUPS.get(code)
    if group is None:
        known = " ".join(each for each in GROUPS if each[0] == letter)
        raise InputError(f"{code} is not understood: there are {known}")
    if group in codes:
        raise InputError(f"{code}: beside {codes[group]}; a line has one word for {group}")
    codes[group] = code
