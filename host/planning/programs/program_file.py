"""Read programs from TOML. Every error begins with the file and the place, as in `step 3: speed_mm_s: is missing`."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, make_dataclass
from functools import cache
from pathlib import Path
from reprlib import repr as short
from typing import Annotated, Any, Final, Literal

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX, STEP_FILES_BYTES_MAX, size_text
from steptwin.host.common.file_models import FileReading, FileTable, read_model
from steptwin.host.common.file_values import ReadBy
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_old_text, read_text
from steptwin.host.common.tables import toml_table
from steptwin.host.planning.drives import AskedLimits
from steptwin.host.planning.programs.pallets import Pallet, PalletTable, PlacedPosition, WorkFrame
from steptwin.host.planning.programs.positions import AnyTarget, PositionsFile, position_schema, read_any_positions
from steptwin.host.planning.programs.program import Place, Program, Steps
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
class ProgramReading:
    """What the tables of a program share while it is read.

    Attributes:
        folder: folder from which the paths in it count.
        chars: characters of the files that its steps have named so far.
        cells: cells of its pallets so far.
    """

    folder: Path
    chars: int = 0
    cells: int = 0

    def text_of(self, name: str) -> str:
        """Return the text of a file that a step names; raise InputError if all together are longer than one may be."""
        if self.chars <= STEP_FILES_BYTES_MAX:  # behind that no further file is read
            text = read_old_text(str(self.folder / name), STEP_FILES_BYTES_MAX)
            self.chars += len(text)
            if self.chars <= STEP_FILES_BYTES_MAX:
                return text
        raise InputError(f"the files of the program's steps have more than {size_text(STEP_FILES_BYTES_MAX)} together")


def _read_saved(value: object, reading: FileReading) -> PositionsFile:
    if not isinstance(value, str):
        raise InputError(f"{short(value)} is not a text")
    return read_any_positions(str(reading.known.folder / value))


def _text_schema() -> dict[str, Any]:
    return {"type": "string"}


_Frame = Annotated[WorkFrame, ReadBy(WorkFrame.read, position_schema)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramFile(FileTable):
    """A program: the steps of a robot's motion, in mm, degrees and seconds.

    Attributes:
        title: one line that says what it does.
        robot: name of the robot for which it was written, or path of its file.
        start: position where it begins; by default the robot's home position.
        law: law of all steps that do not name another one.
        limits: what the fastest steps keep to besides the joints' limits.
        frames: frames in the station, by name.
        positions_file: file of further positions, as `steptwin positions` saves them.
        positions: positions by name.
        pallets: grids of positions by name.
        sequences: sequences of steps by name, for `call`.
        step: the steps.
    """

    title: str = ""
    robot: str | None = None
    start: AnyTarget | None = None
    law: Literal["s-curve", "fastest"] | None = None
    limits: AskedLimits | None = None
    frames: Mapping[str, _Frame | None] = field(default_factory=dict)
    positions_file: Annotated[PositionsFile, ReadBy(_read_saved, _text_schema)] | None = None
    positions: Mapping[str, PlacedPosition | None] = field(default_factory=dict)
    pallets: Mapping[str, Annotated[Pallet, PalletTable] | None] = field(default_factory=dict)
    sequences: Mapping[str, Steps | None] = field(default_factory=dict)
    step: Steps

    @classmethod
    def missing(cls, key: str, reading: FileReading) -> str:
        """Return what to say of a missing key."""
        del key, reading
        return "is missing: a program has at least one [[step]]"

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Program:
        """Return the program, with what could be read of it."""
        saved: PositionsFile | None = values.get("positions_file")
        own, further = values.get("positions") or {}, saved.positions if saved else {}
        for twice in [name for name in own if name in further]:
            file = reading.file["positions_file"]
            reading.findings.add(f"positions_file: {twice!r} is in {file} and in this program: rename one of them")
        keys = [key for key in cls.__dataclass_fields__ if key not in ProgramFile.__dataclass_fields__]
        return Program(
            title=values.get("title") or "",
            robot=values.get("robot"),
            start=values.get("start"),
            positions={**own, **further},
            positions_for=saved.robot if saved else None,
            sequences=values.get("sequences") or {},
            steps=values.get("step") or (),
            pallets=values.get("pallets") or {},
            limits=values.get("limits"),
            expects={key: values[key] for key in keys if values.get(key) is not None},
            folder=reading.known.folder,
            starts="start" in values,
            has_all_names=values.keys() >= {"positions_file", "positions", "pallets", "sequences"},
        )


def program_model() -> type[Any]:
    """Return the model of program files, with the keys of the features that are installed."""
    return _with_keys(tuple(keys for _, keys in giving("program_keys")))


@cache
def _with_keys(given: tuple[Callable[[], Mapping[str, Any]], ...]) -> type[Any]:
    own = [(key, hint | None, None) for keys in given for key, hint in keys().items()]
    names = {"__doc__": ProgramFile.__doc__}
    return make_dataclass("ProgramFile", own, bases=(ProgramFile,), frozen=True, kw_only=True, namespace=names)


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
    program: Program = read_model(program_model(), toml_table(text).values, findings, ProgramReading(folder))
    return program


def verb_of_suffix() -> dict[str, str]:
    """Return the verb of the step that runs a file, by the file's ending, for files that are no programs themselves."""
    steps = {verb: model for _, steps in giving("program_steps") for verb, model in steps().items()}
    return {suffix: verb for verb, model in steps.items() for suffix in model.suffixes}
