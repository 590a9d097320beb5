"""Read programs from TOML. Every error begins with the file and the place, as in `step 3: speed_mm_s: is missing`."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from steptwin.host.common.bad_input import nearest, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import features, giving
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX, STEP_FILES_BYTES_MAX, size_text
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_old_text, read_text
from steptwin.host.common.tables import Reading, Table, toml_table
from steptwin.host.planning.drives import AskedLimits
from steptwin.host.planning.paths import Smoothing
from steptwin.host.planning.programs import steps
from steptwin.host.planning.programs.paces import (
    RAMP_S,
    SPEED_PERCENT,
    TURN_SPEED_DEG_S,
    JointPace,
    LawName,
    OnTheWay,
    ProgramLaw,
    ToolPace,
)
from steptwin.host.planning.programs.pallets import Pallet, WorkFrame, read_pallet
from steptwin.host.planning.programs.positions import (
    JointPosition,
    Position,
    ToolPosition,
    read_any_positions,
    read_position,
    read_target,
)
from steptwin.host.planning.programs.program import STEPS_MAX, AnyStep, Call, Each, Place, Program, Repeat, WrongStep
from steptwin.host.planning.programs.steps import Step


class Complaints:
    """Mistakes in the steps of a program, by their numbers, in the order that they are made."""

    def __init__(self) -> None:
        self._judged: Counter[str] = Counter()
        """Number of times that a step was judged."""
        self._wrong: dict[str, dict[Place, list[str]]] = {}
        """Mistakes in a step, at each place that has its number."""
        self._texts: dict[str, str] = {}

    def __bool__(self) -> bool:
        return bool(self._wrong)

    def judge(self, place: Place) -> None:
        """Note that a step is judged once more."""
        self._judged[place.number] += 1

    def add(self, place: Place, step: Step, error: InputError) -> None:
        """Add what is wrong with a step."""
        self._wrong.setdefault(place.number, {}).setdefault(place, []).extend(error.messages)
        self._texts[place.number] = str(step)

    def messages(self) -> Iterator[str]:
        """Yield the messages of the first pass of each step; later ones only repeat them."""
        for number, wrong in self._wrong.items():
            first, messages = next(iter(wrong.items()))
            where = pass_words(first, len(wrong), self._judged[number])
            for message in messages:
                yield f"step {number} ({self._texts[number]}{where}): {message}"


def pass_words(first: Place, wrong: int, judged: int) -> str:
    """Return the passes where a step is wrong: `, in every pass`, the first one, or nothing without repetition."""
    if not first.passes:
        return ""
    word = first.pass_word
    return f", in every {word}" if judged > 1 and wrong == judged else f", in {word} {first.pass_text}"


SUFFIX: Final = ".toml"


@dataclass(slots=True)
class Usual:
    """What all steps of a program share.

    Attributes:
        keys: keys that each step has that moves, unless it says otherwise.
        folder: folder from which the paths in it count.
        frames: the frames, None for one that is wrong.
        chars: characters of the files that its steps have named so far.
    """

    keys: Mapping[str, object]
    folder: Path
    frames: Mapping[str, WorkFrame | None]
    chars: int = 0

    def text_of(self, name: str) -> str:
        """Return the text of a file that a step names; raise InputError if all together are longer than one may be."""
        if self.chars <= STEP_FILES_BYTES_MAX:  # behind that no further file is read
            text = read_old_text(str(self.folder / name), STEP_FILES_BYTES_MAX)
            self.chars += len(text)
            if self.chars <= STEP_FILES_BYTES_MAX:
                return text
        raise InputError(f"the files of the program's steps have more than {size_text(STEP_FILES_BYTES_MAX)} together")


class StepReading(NamedTuple):
    """Reads a step of a feature.

    Attributes:
        keys: the keys that it may have beside its verb.
        read: makes it of its table.
        suffixes: the usual endings of the files that its verb names; empty if it names none.
    """

    keys: tuple[str, ...]
    read: Callable[[Table, Usual], Step]
    suffixes: tuple[str, ...] = ()


_PROGRAM_KEYS: Final = (
    *("title", "robot", "law", "limits", "start", "positions_file"),
    *("frames", "positions", "pallets", "sequences", "step"),
)
_REPEAT_MAX: Final = 10_000
_FULL_TURN_DEG: Final = 360.0


def read_program(path: Path | str) -> Program:
    """Return the program in a file; raise InputError, with file and place, for the first thing that is wrong."""
    findings = Findings()
    with prefixed(f"{path}: "):
        program = parse_program(read_text(path, PROGRAM_BYTES_MAX), findings, Path(path).parent)
        findings.raise_first()
    return program


def parse_program(text: str, findings: Findings, folder: Path = Path()) -> Program:
    """Return the program of a TOML text, without the parts that are wrong: these are added to the findings.

    The files that it names are looked for from `folder` on. Raises InputError only for a text that is not
    TOML.
    """
    title, robot, start = "", None, None
    table = toml_table(text)
    with findings.collecting():
        title = table.optional("title", table.text) or ""
    with findings.collecting():
        robot = table.optional("robot", table.text)
    with findings.collecting():
        start = read_target(table, "start") if "start" in table else None
    starts = start is not None or "start" not in table
    keys: dict[str, object] = {}
    with findings.collecting():
        if "law" in table:
            keys["law"] = table.choice("law", ProgramLaw).value
    limits = None
    with findings.collecting():
        limits = read_limits(table) if "limits" in table else None
    names = Findings()
    frames = _frames(table, findings, names)
    usual = Usual(keys, folder, frames)
    positions = _positions(table, frames, findings, names)
    saved_for = _add_saved(positions, table, folder, names)
    pallets = _pallets(table, frames, positions, findings, names)
    sequences = _sequences(table, findings, names, usual)
    findings.messages.extend(names.messages)
    program = Program(
        title=title,
        robot=robot,
        start=start,
        positions=positions,
        positions_for=saved_for,
        sequences=sequences,
        steps=_steps(_list(table, "step", findings), "step ", findings, usual),
        pallets=pallets,
        limits=limits,
        expects=_expects(table, findings),
        folder=folder,
        starts=starts,
        has_all_names=not names.messages,
    )
    with findings.collecting():
        table.check_keys((*_PROGRAM_KEYS, *_feature_keys()))
    with findings.collecting():
        if not table.values.get("step"):
            raise InputError("step: is missing: a program has at least one [[step]]")
    return program


class LimitsFrom(StrEnum):
    """Where the limits of fastest motions come from besides the joints."""

    MOTORS = "motors"


def read_limits(table: Table) -> AskedLimits:
    """Return what `[limits]` asks for, such as `from = "motors"` and `left_percent = 30`; InputError if it is wrong."""
    with table.section("limits") as own:
        own.check_keys(("from", "left_percent"))
        own.choice("from", LimitsFrom)
        if "left_percent" not in own:
            return AskedLimits()
        with prefixed("left_percent: "):
            return AskedLimits(own.number("left_percent"))


def _expects(table: Table, findings: Findings) -> dict[str, Any]:
    """Return the values of features' keys; without those that are wrong."""
    found: dict[str, Any] = {}
    for key, read in _feature_keys().items():
        if key in table:
            with findings.collecting():
                found[key] = read(table, key)
    return found


def _feature_keys() -> dict[str, Reading]:
    return {key: read for feature in features().values() for key, read in feature.program_keys.items()}


def _frames(table: Table, findings: Findings, names: Findings) -> dict[str, WorkFrame | None]:
    """Return the frames by name, None for one that is wrong."""
    return _named(table, "frames", WorkFrame.read, findings, names)


def _pallets(
    table: Table,
    frames: Mapping[str, WorkFrame | None],
    positions: Mapping[str, Position | None],
    findings: Findings,
    names: Findings,
) -> dict[str, Pallet | None]:
    """Return the pallets by name, None for one that is wrong."""
    cells = 0

    def read(own: Table) -> Pallet:
        nonlocal cells
        pallet = read_pallet(own, frames, positions, cells)
        cells += len(pallet.cells)
        return pallet

    return _named(table, "pallets", read, findings, names)


Named = TypeVar("Named")


def _named(
    table: Table, key: str, read: Callable[[Table], Named], findings: Findings, names: Findings
) -> dict[str, Named | None]:
    """Return what a table of tables names, None for what is wrong; without the names these are added to `names`."""
    found: dict[str, Named | None] = {}
    with names.collecting():
        if key in table:
            with table.section(key) as named:
                for name in named:
                    found[name] = None
                    with findings.collecting(f"{key}.{name}: "):
                        found[name] = read(Table(named.values[name], "table"))
    return found


def _positions(
    table: Table, frames: Mapping[str, WorkFrame | None], findings: Findings, names: Findings
) -> dict[str, Position | None]:
    """Return the positions by name, None for one that is wrong."""

    def read(own: Table) -> Position:
        if "frame" not in own:
            return read_position(own)
        frame = frames.get(own.text("frame", empty=False))
        if frame is None:
            raise unknown("frame:", own.text("frame"), frames)
        position = read_position(Table({key: own.values[key] for key in own if key != "frame"}, "table"))
        if not isinstance(position, ToolPosition):
            raise InputError("frame: beside joints; a position in a frame is the tool's")
        return frame.placed(position)

    return _named(table, "positions", read, findings, names)


def _add_saved(positions: dict[str, Position | None], table: Table, folder: Path, findings: Findings) -> str | None:
    """Add the positions of the file that a program names; return the name of the robot for which they were saved."""
    owner: str | None = None
    with findings.collecting():
        if "positions_file" in table:
            name = table.text("positions_file", empty=False)
            with prefixed("positions_file: "):
                owner, saved = read_any_positions(str(folder / name))
                for twice in saved.keys() & positions.keys():
                    raise InputError(f"{twice!r} is in {name} and in this program: rename one of them")
            positions |= saved
    return owner


def _sequences(table: Table, findings: Findings, names: Findings, usual: Usual) -> dict[str, tuple[AnyStep, ...]]:
    sequences: dict[str, tuple[AnyStep, ...]] = {}
    with names.collecting():
        if "sequences" in table:
            with table.section("sequences") as named:
                for name in named:
                    sequences[name] = ()
                    with findings.collecting("sequences."):
                        sequences[name] = _steps(
                            _some(named, name, f"sequences.{name}"), f"sequences.{name} step ", findings, usual
                        )
    return sequences


def _some(table: Table, key: str, header: str = "") -> list[object]:
    """Return the values of a list that has at least one."""
    elements = _elements(table, key, header)
    if not elements:
        raise InputError(f"{key}: has no steps")
    return elements


def _list(table: Table, key: str, findings: Findings) -> list[object]:
    with findings.collecting():
        return _elements(table, key, key) if key in table else []
    return []


def _elements(table: Table, key: str, header: str) -> list[object]:
    """Return the values of a list; the InputError for a table says how to begin a list of tables under a header."""
    if header and isinstance(table.values.get(key), dict):
        raise InputError(f"{key}: is a table, not a list: begin each step with [[{header}]], in two pairs of brackets")
    elements = table.elements(key)
    if len(elements) > STEPS_MAX:
        raise InputError(f"{key}: has {len(elements)} steps; a program has at most {STEPS_MAX}")
    return elements


def _steps(elements: Iterable[object], place: str, findings: Findings, usual: Usual) -> tuple[AnyStep, ...]:
    made: list[AnyStep] = []
    for number, element in enumerate(elements, 1):
        step: AnyStep = WrongStep(moves=not (isinstance(element, dict) and any(verb in element for verb in _STANDING)))
        with findings.collecting(f"{place}{number}: "):
            step = _step(Table(element, "table"), f"{place}{number}.", findings, usual)
        made.append(step)
    return tuple(made)


def _step(table: Table, place: str, findings: Findings, usual: Usual) -> AnyStep:
    of_features = _steps_of_features()
    known = (*_VERBS, *of_features, *_OTHERS)
    verbs = [key for key in table if key in known]
    if len(verbs) != 1:
        meant = [f"{key!r} is unknown: did you mean {near}?" for key in table if (near := _meant(key, known))]
        if meant and not verbs:
            raise InputError(meant[0])
        given = " and ".join(verbs) or "none"
        raise InputError(f"a step has exactly one of {', '.join(known)}, not {given}")
    verb = verbs[0]
    if verb == "repeat":
        table.check_keys(("repeat", "steps"))
        return _repeat(table, place, findings, usual)
    if verb == "each":
        table.check_keys(("each", "cells", "steps"))
        names = [table.text("each")] if isinstance(table.values["each"], str) else _texts(table, "each")
        cells = table.text("cells") if "cells" in table else None
        return Each(tuple(names), cells, _steps(_some(table, "steps"), place, findings, usual))
    if verb in of_features:
        of_feature = of_features[verb]
        table.check_keys((verb, *of_feature.keys))
        return of_feature.read(table, usual)
    read, keys = _VERBS[verb]
    table.check_keys((verb, *keys))
    if "duration_s" not in table:
        table = Table({**{key: value for key, value in usual.keys.items() if key in keys}, **table.values}, "table")
    return read(table)


def _steps_of_features() -> dict[str, StepReading]:
    return {verb: reading for _, steps in giving("program_steps") for verb, reading in steps().items()}


def verb_of_suffix() -> dict[str, str]:
    """Return the verb of the step that runs a file, by the file's ending, for files that are no programs themselves."""
    return {suffix: verb for verb, reading in _steps_of_features().items() for suffix in reading.suffixes}


def _meant(key: str, verbs: Iterable[str]) -> str | None:
    """Return the verb that an unknown key may stand for: other programs' words for it, or the nearest name."""
    near = nearest(key, verbs)
    return _OTHER_WORDS.get(key) or (near[0] if near else None)


def _texts(table: Table, key: str) -> list[str]:
    """Return a list of texts that has at least one."""
    values = table.elements(key)
    if not values or not all(isinstance(value, str) for value in values):
        raise InputError(f"{key}: is the name of a pallet, or a list of names")
    return [str(value) for value in values]


def _repeat(table: Table, place: str, findings: Findings, usual: Usual) -> Repeat:
    times = table.integer("repeat")
    if not 1 <= times <= _REPEAT_MAX:
        raise InputError(f"repeat: {times} is not from 1 to {_REPEAT_MAX}")
    return Repeat(times, _steps(_some(table, "steps"), place, findings, usual))


# --- the verbs


def _go(table: Table) -> AnyStep:
    return steps.GoStep(read_target(table, "go"), _joint_pace(table))


def _line(table: Table) -> AnyStep:
    return steps.LineStep(read_target(table, "line"), _tool_pace(table))


def _arc(table: Table) -> AnyStep:
    with table.section("arc") as arc:
        arc.check_keys(("via", "to"))
        via, to = read_target(arc, "via"), read_target(arc, "to")
    return steps.ArcStep(via, to, _tool_pace(table))


def _circle(table: Table) -> AnyStep:
    with table.section("circle") as centre:
        centre.check_keys(("x", "y"))
        x_mm, y_mm = centre.number("x"), centre.number("y")
    sweep_deg = table.number("sweep_deg") if "sweep_deg" in table else _FULL_TURN_DEG
    turned = table.truth("turned") if "turned" in table else False
    return steps.CircleStep(x_mm, y_mm, sweep_deg, turned, _tool_pace(table))


def _through(table: Table) -> AnyStep:
    targets = [read_target(Table({"through": element}, "table"), "through") for element in table.elements("through")]
    smoothing = table.choice("smoothing", Smoothing) if "smoothing" in table else Smoothing.C2_SPLINE
    return steps.ThroughStep(tuple(targets), smoothing, _tool_pace(table))


def _by(table: Table) -> AnyStep:
    with prefixed("by: "):
        position = read_position(Table(table.values["by"], "table"))
    match position:
        case JointPosition(joints):
            table.check_keys(("by", *_JOINT_PACE))
            return steps.JointsBy(joints, _joint_pace(table))
        case ToolPosition(coordinates, None, None):
            table.check_keys(("by", *_TOOL_PACE))
            return steps.ToolBy(coordinates, _tool_pace(table))
        case ToolPosition(_, None, orientation):
            raise InputError(f"by.{orientation and orientation.key}: a relative move turns by rx, ry, rz, in degrees")
        case _:
            raise InputError("by.branch: a relative move keeps the branch")


def _output(table: Table) -> AnyStep:
    return steps.OutputStep(table.text("output", empty=False), table.truth("on"))


def _wait(table: Table) -> AnyStep:
    time_s = table.values.get("wait")
    if isinstance(time_s, int | float) and not isinstance(time_s, bool):
        raise InputError(f"wait: {time_s:g} names no input; a time to stand is `pause = {time_s:g}`, in seconds")
    return steps.WaitStep(table.text("wait", empty=False), table.truth("on"), table.number("timeout_s"))


def _pause(table: Table) -> AnyStep:
    return steps.PauseStep(table.number("pause"))


def _call(table: Table) -> AnyStep:
    return Call(table.text("call", empty=False))


_JOINT_PACE: Final = ("law", "speed_percent", "duration_s", "blend_mm")
_TOOL_PACE: Final = ("speed_mm_s", "speed_deg_s", "ramp_s", "law", "blend_mm", "outputs")

_OTHERS: Final = ("repeat", "each")
"""The verbs of steps that hold other steps."""

_STANDING: Final = ("output", "wait", "pause")
"""The verbs of steps that let the robot stand."""

_OTHER_WORDS: Final = dict.fromkeys(("wait_s", "pause_s", "sleep", "delay", "dwell"), "pause")
"""Words that authors write for a verb."""

_VERBS: Final[dict[str, tuple[Callable[[Table], AnyStep], tuple[str, ...]]]] = {
    "go": (_go, _JOINT_PACE),
    "line": (_line, _TOOL_PACE),
    "arc": (_arc, _TOOL_PACE),
    "circle": (_circle, ("sweep_deg", "turned", *_TOOL_PACE)),
    "through": (_through, ("smoothing", *_TOOL_PACE)),
    "by": (_by, (*_JOINT_PACE, *_TOOL_PACE)),
    "output": (_output, ("on",)),
    "wait": (_wait, ("on", "timeout_s")),
    "pause": (_pause, ()),
    "call": (_call, ()),
}
"""The verbs, each with its reader and the other keys that a step with it may have."""


def _joint_pace(table: Table) -> JointPace:
    speed_percent = table.optional("speed_percent", table.number)
    duration_s = table.optional("duration_s", table.number)
    blend_mm = table.optional("blend_mm", table.number)
    if speed_percent is not None and duration_s is not None:
        raise InputError("speed_percent: beside duration_s; a joint move takes one of them")
    law = table.choice("law", LawName) if "law" in table else LawName.S_CURVE
    if blend_mm is not None and "law" in table and law is not LawName.FASTEST:
        raise InputError(f"law: {law.value!r} beside blend_mm; a motion that flows on is timed as a whole, 'fastest'")
    return JointPace(law, SPEED_PERCENT if speed_percent is None else speed_percent, duration_s, blend_mm)


def _tool_pace(table: Table) -> ToolPace:
    ramp_s = table.number("ramp_s") if "ramp_s" in table else RAMP_S
    turning_deg_s = table.number("speed_deg_s") if "speed_deg_s" in table else TURN_SPEED_DEG_S
    law = table.choice("law", LawName) if "law" in table else LawName.S_CURVE
    blend_mm = table.optional("blend_mm", table.number)
    outputs = table.each("outputs", _on_the_way) if "outputs" in table else ()
    return ToolPace(table.number("speed_mm_s"), ramp_s, turning_deg_s, law, blend_mm, outputs)


def _on_the_way(table: Table) -> OnTheWay:
    """Return a change of an output on the way, such as `{ glue = true, at_mm = 3.0 }`."""
    names = [key for key in table if key not in ("at_mm", "ahead_s")]
    if len(names) != 1:
        raise InputError(f"names {len(names)} outputs; one change is such as {{ glue = true, at_mm = 3.0 }}")
    ahead_s = table.number("ahead_s") if "ahead_s" in table else 0.0
    return OnTheWay(names[0], table.truth(names[0]), table.number("at_mm"), ahead_s)
