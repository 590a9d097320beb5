"""Read a text of G-code into blocks of words; what is not understood is refused with its line and word.

The words are those of RS274/NGC (T. Kramer, F. Proctor, E. Messina, "The NIST RS274NGC Interpreter, Version 3", NIST
IR 6556, 2000) that make sense for a tool path of an arm. Without a dialect no word is skipped: what a machine does not
do would be seen in the part only. With a dialect, words that move nothing are skipped and counted (dialects.py).
"""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from typing import Final

from steptwin.features.gcode.dialects import (
    MACRO_NOTE,
    MANNERS,
    Dialect,
    Manners,
    Use,
    Word,
    knowing,
    macro_use,
    uses_of,
)
from steptwin.host.common.bad_input import printable, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings

LINES_MAX: Final = 200_000
"""Lines of a file: ten times those of a large part."""
LINE_CHARS_MAX: Final = 256
"""Characters of a line without its comment, as in RS274/NGC."""
VALUE_MAX: Final = 1e6
"""Size of a number: a kilometre, or a feed of a thousand metres a minute."""
REFUSALS_MAX: Final = 20
"""Refusals of a file that are told at once."""

_NUMBER: Final = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
_WORD: Final = re.compile(rf"([A-Za-z])[ \t]*({_NUMBER})|\(([^()]*)\)")
_SPACE: Final = re.compile(r"[ \t\r]*")
_CHECKED: Final = re.compile(r"([^*;(]*)\*[ \t]*([0-9]{1,3})[ \t\r]*(?:;.*)?")
"""A line with a checksum: the exclusive or of the bytes before the asterisk."""
_COMMAND: Final = re.compile(r"(?:N[ \t]*[0-9]+[ \t]*)?(?:([GMT])[ \t]*([0-9]+(?:\.[0-9]+)?)|([A-Z_][A-Z_][A-Z0-9_]*))")
"""The command of a line of a printer: a word, or a macro."""
_PARAMETER: Final = re.compile(rf"([A-Z])[ \t]*({_NUMBER})?[ \t]*")

NUMBERS: Final = ("X", "Y", "Z", "A", "C", "I", "J", "K", "R", "F", "P", "Q", "S", "L")
"""The other words that are understood; N is a line's number, which says nothing."""
_PARAMETERS: Final = {"motion": "XYZFIJKRPQS", "G4": "PS", "G28": "XYZ", "G92": "XYZ", "G52": "XYZ", "M220": "S"}
"""The parameters of a printer's command that are read, by its group or by itself."""
_OF_OUTPUTS: Final = ("spindle", "coolant", "outputs")
_ENDS: Final = ("M2", "M30")


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


@dataclass(frozen=True, slots=True)
class GcodeFile:
    """A file of G-code.

    Attributes:
        blocks: its lines that have words, in order.
        manners: the manners of its dialect.
        ignored: how often each word was ignored.
        notes: what is worth saying about ignored words, each once.
    """

    blocks: tuple[GcodeBlock, ...]
    manners: Manners
    ignored: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def remarks(self) -> tuple[str, ...]:
        """Return the ignored words as a line of text, and the notes."""
        times = (f"{word} {count} time{'' if count == 1 else 's'}" for word, count in sorted(self.ignored.items()))
        return (f"ignored: {', '.join(times)}", *self.notes) if self.ignored else self.notes


def read_blocks(
    text: str, dialect: Dialect | None = None, ignore: Collection[str] = (), outputs: Collection[str] | None = None
) -> GcodeFile:
    """Return the blocks of a text that have words, in order.

    Args:
        text: the file's text.
        dialect: the controller for which it has been written; None for the words that are the same for all of them.
        ignore: further words to ignore, and macros.
        outputs: words of spindle, coolant and outputs that switch something; with a dialect, others are ignored.

    Raises:
        InputError: words are not understood or stand behind the program's end. The messages have line and word; the
            first REFUSALS_MAX are told.
    """
    lines = text.rstrip("\x1a\0").split("\n")
    if len(lines) > LINES_MAX:
        raise InputError(f"has {len(lines)} lines; at most {LINES_MAX} are read")
    reader = _LineReader(dialect, {word.upper() for word in ignore}, outputs)
    blocks: list[GcodeBlock] = []
    wrong = Findings()
    percents, ended = 0, 0
    for number, line in enumerate(lines, 1):
        if len(wrong.messages) >= REFUSALS_MAX:
            break
        if line.split(";", 1)[0].strip() == "%" and "(" not in line:
            percents += 1
            ended = ended or (number if (percents > 1 or blocks) and not reader.goes_on_behind_percent else 0)
            continue
        if ended and reader.ends_reading:
            break
        with wrong.collecting(f"line {number}: "):
            block = reader.block(number, line)
            if not block.codes and not block.numbers:
                continue
            if ended and dialect is not None and not block.numbers and block.codes.keys() <= {"stops"}:
                continue
            if ended:
                raise InputError(f"{line.strip()[:20]!r} is behind the program's end in line {ended}")
            blocks.append(block)
            if block.codes.get("stops") in _ENDS:
                ended = number
    wrong.raise_first()
    if not blocks:
        raise InputError("has no words of G-code")
    return GcodeFile(tuple(blocks), reader.manners, dict(reader.ignored), reader.remarks())


class _LineReader:
    """Reads lines in a dialect, and counts what it ignores."""

    def __init__(self, dialect: Dialect | None, ignore: Collection[str], outputs: Collection[str] | None) -> None:
        self.manners = MANNERS[dialect]
        self.ignored: Counter[str] = Counter()
        self.ends_reading = dialect is Dialect.LINUXCNC
        self.goes_on_behind_percent = self.manners.one_command or dialect in (Dialect.GRBL, Dialect.GRBLHAL)
        self._dialect, self._ignore = dialect, ignore
        self._outputs = outputs if dialect is not None else None
        self._uses = uses_of(dialect)
        self._letters = {*NUMBERS, "G", "M", "N", *ignore, *("TEHD" if dialect is not None else "")}
        self._why: dict[str, str] = {}
        self._tool = ""

    def remarks(self) -> tuple[str, ...]:
        """Return the notes about ignored words, those with the same text together."""
        texts = dict.fromkeys(self._why.values())
        return tuple(f"{', '.join(word for word, why in self._why.items() if why == text)}: {text}" for text in texts)

    def block(self, number: int, line: str) -> GcodeBlock:
        """Return the block of a line, which may be empty; raise InputError, with the word, for what is wrong in it."""
        line = _without_checksum(line)
        if len(line.split(";", 1)[0].rstrip()) > LINE_CHARS_MAX:
            raise InputError(f"has {len(line)} characters; a line has at most {LINE_CHARS_MAX}")
        if self.manners.one_command:
            codes, numbers = self._command(line.split(";", 1)[0].strip().upper())
        elif self._dialect is not None and line.startswith("$"):
            codes, numbers = self._setting(line.split(";", 1)[0].strip().upper()), {}
        else:
            codes, numbers = self._words(line)
        if self._outputs is not None:
            self._drop_outputs(codes, numbers)
        return GcodeBlock(number, codes, numbers)

    def _count(self, word: str, why: str = "") -> None:
        self.ignored[word] += 1
        if why:
            self._why[word] = why

    def _use(self, code: str) -> tuple[Use, Word]:
        """Return what is done with a G or M word; raise InputError for one that is refused."""
        if code in self._ignore:
            return Use.IGNORE, Word(code, "", "")
        found = self._uses.get(code)
        if found is None:
            if self.manners.one_command and code[0] == "M":  # Klipper and Marlin report it and continue; nothing moves
                return Use.IGNORE, Word(code, "", "")
            others = ", ".join(knowing(code))
            if self._dialect is not None:
                hint = f"; it is a word of {others}" if others else ""
                raise InputError(f"{code}: {self.manners.name} does not know it{hint}")
            if others:
                without = f"{code} is not understood without a dialect; it is in {others}"
                raise InputError(f"{without} (--dialect, or `dialect` of the step)").plainly(
                    f"{without}: write a program whose step has `dialect` beside `gcode`"
                )
            known = " ".join(each for each in self._uses if each[0] == code[0])
            raise InputError(f"{code} is not understood: there are {known}")
        use, word = found
        if use is Use.REFUSE:
            raise InputError(f"{code}: {word.why}")
        return use, word

    def _set_tool(self, codes: dict[str, str], tool: str, word: str) -> None:
        """Ignore the first tool; let the machine stop for another."""
        if self._tool and tool != self._tool:
            codes["stops"] = word
            self._why[word] = "the machine stops for another tool, whose length is not known"
        else:
            self._count(word)
        self._tool = tool

    def _drop_outputs(self, codes: dict[str, str], numbers: dict[str, float]) -> None:
        """Ignore words of outputs that switch nothing."""
        assert self._outputs is not None
        for group in _OF_OUTPUTS:
            code = codes.get(group, "")
            key = f"P{numbers.get('P', 0):g}" if group == "outputs" else code
            if code and code not in ("M5", "M9") and key not in self._outputs:
                self._count(codes.pop(group))
                if group == "outputs":
                    numbers.pop("P", None)

    # --- lines of one command: Klipper and Marlin

    def _command(self, line: str) -> tuple[dict[str, str], dict[str, float]]:
        found = _COMMAND.match(line)
        if found is None:
            if rest := re.sub(r"\([^()]*\)", "", line).strip():
                raise InputError(
                    f"{printable(rest[:12])!r} is not understood: a line of {self.manners.name} begins with a command"
                )
            return {}, {}
        if found[3]:
            self._macro(found[3])
            return {}, {}
        code, rest = f"{found[1]}{float(found[2]):g}", line[found.end() :]
        if self._dialect is Dialect.KLIPPER and code != found[1] + found[2]:
            raise InputError(f"{found[1]}{found[2]}: Klipper does not know it; write {code}")
        codes: dict[str, str] = {}
        if found[1] == "T":
            self._set_tool(codes, code, code)
            return codes, {}
        if code == "M92" and not re.search("[XYZ]", rest):
            self._count(code)
            return {}, {}
        use, word = self._use(code)
        if use is not Use.APPLY:
            if code == "G10" and "L" in rest and code not in self._ignore:
                raise InputError(f"G10: {self.manners.name} retracts the filament; an origin is not set")
            self._count(code, word.why if use is Use.NOTE else "")
            return {}, {}
        codes[word.group] = code
        return codes, {} if word.group in ("stops", "outputs") else self._parameters(codes, code, rest)

    def _macro(self, name: str) -> None:
        use = Use.IGNORE if name in self._ignore else macro_use(name)
        if self._dialect is not Dialect.KLIPPER and name not in self._ignore:
            of_klipper = f"{shortened(name)}: is a macro of Klipper"
            raise InputError(f"{of_klipper}: --dialect klipper, or list it in `ignore`").plainly(
                f"{of_klipper}: write a program whose step has `dialect` beside `gcode`"
            )
        if use is Use.REFUSE:
            raise InputError(f"{shortened(name)}: is a macro, which may move the machine; list it in `ignore`")
        self._count(name, MACRO_NOTE if use is Use.NOTE else "")

    def _parameters(self, codes: dict[str, str], code: str, rest: str) -> dict[str, float]:
        group = next(iter(codes))
        read = _PARAMETERS.get(code) or _PARAMETERS.get(group, "S")
        numbers: dict[str, float] = {}
        extruder, at = False, _after_space(rest, 0)
        while at < len(rest):
            found = _PARAMETER.match(rest, at)
            if found is None:
                comment = re.compile(r"\([^()]*\)[ \t]*").match(rest, at)
                if comment is None:
                    raise InputError(f"{printable(rest[at : at + 12])!r} is not understood: it is no parameter")
                at = comment.end()
                continue
            at, letter = found.end(), found[1]
            if letter in ("G", "M", "T"):
                raise InputError(
                    f"{printable(found[0].strip())}: beside {code}; {self.manners.name} executes one command a line"
                )
            if letter == "E":
                extruder = True
                self._count("E")
            elif letter in read:
                if found[2] is None and code != "G28":
                    raise InputError(f"{letter}: beside {code}; a number is missing")
                numbers[letter] = _value(letter, found[2] or "0")
            elif group == "motion":
                raise InputError(f"{printable(found[0].strip())} is not understood: {code} takes {' '.join(read)} E")
        if code == "G92" and not numbers:
            if extruder or self._dialect is Dialect.MARLIN:
                codes.clear()
            else:  # Klipper sets all axes to 0
                numbers = dict.fromkeys("XYZ", 0.0)
        if code == "G4" and not numbers:
            numbers["P"] = 0.0
        return numbers

    # --- lines of several words

    def _setting(self, line: str) -> dict[str, str]:
        """Return what a line with a $ does in grbl: it homes, or unlocks."""
        if self._dialect in (Dialect.GRBL, Dialect.GRBLHAL) and line in ("$H", "$X"):
            if line == "$H":
                return {"single actions": line}
            self._count(line)
            return {}
        raise InputError(f"{printable(line[:12])!r} is not understood: there are $H and $X, in grbl")

    def _words(self, line: str) -> tuple[dict[str, str], dict[str, float]]:
        codes, numbers, seen_n = dict[str, str](), dict[str, float](), False
        words = self._understood(line)
        own = [f"{letter}{value:g}" for letter, _, value in words if letter in ("G", "M")]
        if given := [code for code in own if code in self._ignore and code[0] == "G"]:
            self._count(given[0])  # an ignored G word takes its line with it: the other words may be its own
            return {}, {}
        taken = "".join(word.takes for code in own if (word := self._ignored_row(code)) is not None)
        tool = next((f"{value:g}" for letter, _, value in words if letter == "T"), "")
        for letter, digits, value in words:
            if letter in ("G", "M"):
                self._add_code(codes, f"{letter}{value:g}", tool)
            elif letter == "N":
                if seen_n or codes or numbers:
                    raise InputError(f"N{shortened(digits)}: a line's number is its first word")
                seen_n = True
            elif letter in taken:
                continue
            elif letter in self._ignore or (letter == "T" and self._dialect is not None):
                self._count(letter)
            elif letter not in NUMBERS:
                raise InputError(f"{letter}{shortened(digits)}: no word of the line takes it")
            elif letter in numbers:
                raise InputError(f"{letter}{shortened(digits)}: a line has one {letter} word")
            else:
                numbers[letter] = value
        return codes, numbers

    def _understood(self, line: str) -> list[tuple[str, str, float]]:
        """Return letter, digits and value of each word of a line; raise InputError for the first that is refused."""
        words = list[tuple[str, str, float]]()
        for letter, digits in _words(line, opened=self._dialect in (Dialect.GRBL, Dialect.GRBLHAL)):
            if letter not in self._letters:
                known = " ".join(NUMBERS)
                raise InputError(f"{letter}{shortened(digits)} is not understood: there are {known}, G and M")
            value = _value(letter, digits)
            if letter in ("G", "M"):
                self._use(f"{letter}{value:g}")
            words.append((letter, digits, value))
        return words

    def _ignored_row(self, code: str) -> Word | None:
        use, word = self._uses.get(code, (Use.REFUSE, None))
        return word if use in (Use.IGNORE, Use.NOTE) else None

    def _add_code(self, codes: dict[str, str], code: str, tool: str) -> None:
        use, word = self._use(code)
        if use is not Use.APPLY:
            self._count(code, word.why if use is Use.NOTE else "")
        elif word.group == "tool":
            self._set_tool(codes, tool or f"after {self._tool}", code)
        elif self._dialect is not None and word.group == "motion" and "G80" in (code, codes.get("motion")):
            if code != "G80":  # beside another motion, G80 only ends a cycle
                codes["motion"] = code
            codes.setdefault("motion", code)
        elif word.group in codes:
            raise InputError(f"{code}: beside {codes[word.group]}; a line has one word for {word.group}")
        else:
            codes[word.group] = code


def _without_checksum(line: str) -> str:
    """Return a line without its checksum; raise InputError for a wrong one."""
    found = _CHECKED.fullmatch(line)
    if found is None:
        return line
    right = reduce(xor, found[1].encode(), 0)
    if int(found[2]) != right:
        raise InputError(f"*{found[2]}: the checksum of the line is {right}; a part of it was lost")
    return found[1]


def _value(letter: str, digits: str) -> float:
    value = float(digits)
    if not abs(value) <= VALUE_MAX:
        raise InputError(f"{letter}{shortened(digits)}: a number is at most {VALUE_MAX:g} in size")
    return value


def _words(line: str, *, opened: bool) -> Iterator[tuple[str, str]]:
    """Yield letter and digits of each word of a line; raise InputError for what is neither a word nor a comment.

    A comment without its end takes the rest of the line if that is allowed (`opened`).
    """
    at = _after_space(line, 0)
    while at < len(line) and line[at] != ";":
        found = _WORD.match(line, at)
        if found is None:
            if opened and line[at] == "(" and ")" not in line[at:]:
                return
            raise InputError(f"{printable(line[at : at + 12])!r} is not understood: it is neither a word nor a comment")
        if found[1]:
            yield found[1].upper(), found[2]
        at = _after_space(line, found.end())


def _after_space(line: str, at: int) -> int:
    found = _SPACE.match(line, at)
    return found.end() if found else at


def strict_groups() -> Mapping[str, str]:
    """Return the G and M words that are understood without a dialect, each with its modal group."""
    return {code: word.group for code, (use, word) in uses_of(None).items() if use is Use.APPLY}
