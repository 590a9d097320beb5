"""The words of G-code by dialect: what each controller does with a word, and what a tool path does with it.

Sources: Klipper `klippy/gcode.py`, `extras/gcode_move.py` and `extras/gcode_arcs.py`; Marlin `src/gcode/gcode.h`;
grbl 1.1 and grblHAL `gcode.c`; LinuxCNC `docs/src/gcode`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase
from typing import Final, NamedTuple

SUFFIXES: Final = (".gcode", ".nc", ".ngc")
"""Usual endings of the files' names."""


class Dialect(StrEnum):
    """The controller for which a file has been written."""

    KLIPPER = "klipper"
    MARLIN = "marlin"
    GRBL = "grbl"
    GRBLHAL = "grblhal"
    LINUXCNC = "linuxcnc"


class Use(StrEnum):
    """What is done with a word."""

    APPLY = "A"
    IGNORE = "I"
    NOTE = "N"
    """Ignored, with a note about what the file does not say."""
    REFUSE = "R"
    UNKNOWN = "-"
    """The controller does not know the word."""


@dataclass(frozen=True, slots=True)
class Manners:
    """How a dialect reads lines, besides its words.

    Attributes:
        name: name of the controller; empty for a file without a dialect.
        one_command: True if a line is one command with its parameters, and every move names its G word. Such a
            controller continues after a command that it does not know.
        dwell_s: duration of a unit of `G4 P`.
        feed_mm_s: feed before the first F; None if the controller refuses that.
        motion: motion that holds before the first one that the file names; empty if none does.
        is_strict: True without a dialect: corners of which the file says nothing stop, and G28 has no axis words.
    """

    name: str = ""
    one_command: bool = False
    dwell_s: float = 1.0
    feed_mm_s: float | None = None
    motion: str = ""
    is_strict: bool = False


MANNERS: Final[Mapping[Dialect | None, Manners]] = {
    None: Manners(is_strict=True),
    Dialect.KLIPPER: Manners("Klipper", one_command=True, dwell_s=0.001, feed_mm_s=25.0),
    Dialect.MARLIN: Manners("Marlin", one_command=True, dwell_s=0.001, feed_mm_s=25.0),
    Dialect.GRBL: Manners("grbl", motion="G0"),
    Dialect.GRBLHAL: Manners("grblHAL", motion="G0"),
    Dialect.LINUXCNC: Manners("LinuxCNC"),
}


class Word(NamedTuple):
    """A row of the table.

    Attributes:
        codes: the G and M words.
        group: their modal group, of which a line has one word; empty for words that are never applied.
        uses: a `Use` without a dialect, then in each dialect, in the order of `Dialect`.
        why: reason of a refusal, or what is worth a note about an ignored word.
        takes: letters that belong to an ignored word.
    """

    codes: str
    group: str
    uses: str
    why: str = ""
    takes: str = ""


_PROBES: Final = "the machine probes or homes by itself; these moves are not in the file"
_TOOL_RADIUS: Final = "the tool's radius is not known"
_OFFSET: Final = "it moves the origin by a value of the machine"
_SPINDLE_MOTION: Final = "the motion follows a spindle"

WORDS: Final = (
    Word("G0 G1 G2 G3", "motion", "AAAAAA"),
    Word("G5", "motion", "--A-AA"),
    Word("G5.1", "motion", "----AA"),
    Word("G5.2 G5.3 G6.2 G6.3", "", "----RR", "a spline with weights is not executed"),
    Word("G80", "motion", "AINAAA", "Prusa's firmware probes the bed; these moves are not in the file"),
    Word("G17 G18 G19", "plane", "AAAAAA"),
    Word("G20", "units", "ARAAAA", "Klipper refuses inches"),
    Word("G21", "units", "AAAAAA"),
    Word("G90 G91", "distances", "AAAAAA"),
    Word("G90.1", "centres of arcs", "A----A"),
    Word("G91.1", "centres of arcs", "AIIAAA"),
    Word("G93", "feed", "A--AAA"),
    Word("G94", "feed", "AIIAAA"),
    Word("G95", "", "----RR", _SPINDLE_MOTION),
    Word("G40", "radius of the tool", "AIIAAA"),
    Word("G41 G42", "", "----RR", _TOOL_RADIUS, "D"),
    Word("G43", "", "----NN", "the tool's length is not known, and taken as 0", "H"),
    Word("G43.1", "length of the tool", "A--AAA"),
    Word("G43.2", "", "----RR", "the tool's length is not known"),
    Word("G49", "length of the tool", "AIIAAA"),
    Word("G54", "coordinates", "AIAAAA"),
    Word("G55 G56 G57 G58 G59", "coordinates", "A-AAAA"),
    Word("G59.1 G59.2 G59.3", "coordinates", "A-A-AA"),
    Word("G61", "corners", "A-RIIA", "G61 returns to a stored place"),
    Word("G61.1", "corners", "A---AA"),
    Word("G64", "corners", "A---AA"),
    Word("G60", "", "--R---", "G60 and G61 return to a stored place"),
    Word("G4", "single actions", "AAAAAA"),
    Word("G10", "single actions", "AIIAAA"),
    Word("G11", "", "-II---"),
    Word("G28", "single actions", "AAAAAA"),
    Word("G30", "single actions", "--RAAA", "the machine probes"),
    Word("G28.1 G30.1", "single actions", "---AAA"),
    Word("G52", "single actions", "A-A--A"),
    Word("G53", "machine coordinates", "A-AAAA"),
    Word("G92", "single actions", "AAAAAA"),
    Word("G92.1", "single actions", "A-AAAA"),
    Word("G92.2 G92.3", "single actions", "A---AA"),
    Word("G8 G96 G97", "", "----II", takes="DS"),
    Word("G7 G50 G51", "", "----RR", "places are diameters, or scaled"),
    Word("G98 G99", "retraction", "----AA"),
    Word("G12 G27 G29 G31 G32 G34", "", "-NN---", _PROBES),
    Word("G26 G35 G42 G425", "", "--R---", "the machine moves by itself"),
    Word("G33 G76", "", "--R-RR", _SPINDLE_MOTION),
    Word("G38 G38.2 G38.3 G38.4 G38.5", "", "--RRRR", "the machine moves until a probe touches"),
    Word("G73 G81 G82 G83 G85 G89", "motion", "----AA"),
    Word("G84 G86 G88", "", "----RR", "the spindle stops or turns back"),
    Word("M0 M1", "stops", "AAAAAA"),
    Word("M2 M30", "stops", "AIIAAA"),
    Word("M60", "stops", "----AA"),
    Word("M25 M226 M400", "stops", "-AA---"),
    Word("M3 M4 M5", "spindle", "AAAAAA"),
    Word("M7 M8 M9", "coolant", "AAAAAA"),
    Word("M62 M63 M64 M65", "outputs", "A---AA"),
    Word("M66", "", "----RR", "it waits for an input"),
    Word("M67 M68", "", "----II", takes="EQ"),
    Word("M6", "tool", "---AAA"),
    Word("M19 M61", "", "----II", takes="RQP"),
    Word("M48 M49 M50 M51 M52 M53", "", "----II", takes="P"),
    Word("M56", "", "---III", takes="P"),
    Word("M70 M71 M72", "", "----RR", "the modal state is not stored"),
    Word("M73", "", "-II-RR", "the modal state is not stored"),
    Word("M98 M99", "", "--R-RR", "subprograms are not executed"),
    Word("M17", "", "--I---"),
    Word("M18 M84", "", "-II---"),
    Word("M82 M83 M104 M105 M106 M107 M109 M110 M114 M117 M118 M119 M140 M190 M204 M221", "", "-II---"),
    Word("M220", "feed factor", "-AA---"),
    Word("M92", "", "--R---", "it changes the steps for each mm"),
    Word("M206 M218 M290 M428 M665 M666 M851 M852", "", "--R---", _OFFSET),
    Word("M350 M351", "", "--R---", "it changes the microsteps"),
    Word("M48 M410 M605 M808", "", "--R---", "the machine moves or stops by itself"),
    Word("M112 M999", "", "-RR---", "it stops the machine"),
    Word("M125 M401 M402 M600 M601 M701 M702", "", "-NN---", "the machine moves by itself; not in the file"),
)
"""The G and M words of all dialects. A word that a controller does not know is refused if it stops there."""

MACROS: Final[Mapping[Use, str]] = {
    Use.IGNORE: (
        "EXCLUDE_OBJECT* TIMELAPSE_* SET_PRINT_STATS_INFO SET_DISPLAY_TEXT SET_PRESSURE_ADVANCE SET_RETRACTION"
        " SET_HEATER_TEMPERATURE TEMPERATURE_WAIT TURN_OFF_HEATERS SET_FAN_SPEED SET_PIN SET_LED SET_VELOCITY_LIMIT"
        " SET_INPUT_SHAPER SET_IDLE_TIMEOUT SET_GCODE_VARIABLE SAVE_VARIABLE UPDATE_DELAYED_GCODE SET_STEPPER_ENABLE"
        " SET_FILAMENT_SENSOR SET_TMC_* BED_MESH_CLEAR BED_MESH_PROFILE ACTIVATE_EXTRUDER SYNC_EXTRUDER_MOTION"
        " SET_EXTRUDER_ROTATION_DISTANCE RESPOND CLEAR_PAUSE GET_POSITION STATUS QUERY_* M117 DEFINE_OBJECT*"
    ),
    Use.NOTE: (
        "START_PRINT PRINT_START END_PRINT PRINT_END START END START_GCODE END_GCODE CANCEL_PRINT PAUSE RESUME"
        " BED_MESH_CALIBRATE Z_TILT_ADJUST QUAD_GANTRY_LEVEL CLEAN_NOZZLE NOZZLE_* PURGE* *_PURGE PRIME_* *PARK*"
        " LOAD_FILAMENT UNLOAD_FILAMENT"
    ),
}
"""Klipper's commands and usual macros in capital letters; another macro may move, and is refused."""

MACRO_NOTE: Final = "may move the machine; its moves are not in the file"

_COLUMNS: Final = {dialect: i for i, dialect in enumerate((None, *Dialect))}


def uses_of(dialect: Dialect | None) -> Mapping[str, tuple[Use, Word]]:
    """Return what is done with each G and M word that the table has for a dialect, with its row."""
    column = _COLUMNS[dialect]
    found = ((code, Use(word.uses[column]), word) for word in WORDS for code in word.codes.split())
    return {code: (use, word) for code, use, word in found if use is not Use.UNKNOWN}


def macro_use(name: str) -> Use:
    """Return what is done with a macro of Klipper."""
    for use, patterns in MACROS.items():
        if any(fnmatchcase(name, pattern) for pattern in patterns.split()):
            return use
    return Use.REFUSE


def knowing(code: str) -> list[Dialect]:
    """Return the dialects in which a word is applied or ignored."""
    fine = (Use.APPLY, Use.IGNORE, Use.NOTE)
    return [dialect for dialect in Dialect if uses_of(dialect).get(code, (Use.REFUSE, None))[0] in fine]
