"""Convert requests to faults of a robot's machine, and faults to requests: one notation for all users.

The control port, `steptwin inject` and the faults of a scenario use it; help and docs show it. The fields of the faults
in `features/faults/kinds/` define the keys of a request; this module reads and writes each kind of value. A fault of
the bus names its frames: those of a service, of one joint's node or of all.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, make_dataclass, replace
from functools import cache
from math import inf, isfinite
from reprlib import repr as short
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from steptwin.features.faults.fault import Fault, Key, KeyKind
from steptwin.features.faults.kinds import FAULTS
from steptwin.features.faults.kinds.host import HostFault
from steptwin.host.common import numbers
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.choices import LEVELS, STATE, SWITCHES
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable, read_model
from steptwin.host.common.file_values import ReadBy, Within
from steptwin.host.common.findings import Findings
from steptwin.host.common.numbers import LARGEST
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_MASK,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    FROM_NODE,
    HOST_NODE_ID,
    TO_NODE,
)

if TYPE_CHECKING:
    from steptwin.emulator.operations import Operation
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.live.live_board import LiveBoard


_NODES: Final[Mapping[str, tuple[int, ...]]] = {
    "records": (COB_RPDO[3],),
    "commands": COB_RPDO[:3],
    "requests": (COB_SDO_REQUEST,),
    "answers": (COB_SDO_RESPONSE,),
    "reports": COB_TPDO,
    "emergencies": (COB_EMCY,),
    "heartbeats": (COB_HEARTBEAT,),
    "of-board": FROM_NODE,
}
"""Base identifiers, by name; a joint's node id is added."""
_HOST_FRAMES: Final[Mapping[str, tuple[int, ...]]] = {
    "nmt": (COB_NMT,),
    "sync": (COB_SYNC,),
    "host-heartbeat": (COB_HEARTBEAT + HOST_NODE_ID,),
    "of-host": (COB_NMT, COB_SYNC, COB_HEARTBEAT + HOST_NODE_ID),
    "all": tuple(range(COB_ID_MASK + 1)),
}
"""Identifiers by name."""
_OF_HOST: Final = "of-host"

FRAMES: Final = (*_NODES, *_HOST_FRAMES)
"""Names of frames."""


def cob_ids(robot: "Robot", name: str, axis: int | None = None) -> tuple[int, ...]:
    """Return the identifiers of a name, of one axis' node or of all nodes, in rising order."""
    axes = range(len(robot.axes)) if axis is None else range(axis, axis + 1)
    bases = _NODES.get(name, TO_NODE if name == _OF_HOST else ())
    found = {base + FIRST_NODE_ID + each for base in bases for each in axes}
    return tuple(sorted(found | set(_HOST_FRAMES.get(name, ()))))


def name_of(robot: "Robot", ids: tuple[int, ...]) -> tuple[str, int | None] | None:
    """Return the name of identifiers, and the axis if they belong to one node; None without a name."""
    for axis in (None, *range(len(robot.axes))):
        for name in FRAMES if axis is None else _NODES:
            if cob_ids(robot, name, axis) == ids:
                return name, axis
    return None


DATA_BYTES_MAX: Final = 8
"""Longest data of a frame."""
REQUESTS: Final[Mapping[str, type[Fault] | None]] = {**FAULTS, STATE: None}
"""Class of each request, in the order of help and docs."""
INJECTED: Final = tuple(do for do in REQUESTS if do != HostFault.do)
"""Requests to a served board; its hosts are other programs."""


def sentence(do: str) -> str:
    """Return the description of a request, in Markdown."""
    fault = REQUESTS[do]
    return "nothing: it asks how the machine is" if fault is None else fault.sentence()


def keys_of(do: str) -> dict[str, Key]:
    """Return the keys of a request besides `do`, in the order of a command's words."""
    fault = REQUESTS[do]
    return {} if fault is None else fault.keys()


# --- kinds of values


def read_as(read: Callable[[Any], object], schema: Mapping[str, Any]) -> ReadBy:
    """Return the annotation of a value that a function reads, which raises InputError without the key."""
    return ReadBy(lambda value, _: read(value), lambda: dict(schema))


def by_name(members: Mapping[str, Any]) -> ReadBy:
    """Return the annotation of a value read by name."""
    return read_as(lambda value: members[known_name(value, members)], {"enum": [*members]})


def known_name(value: object, names: Iterable[str]) -> str:
    """Return a name if it is among `names`; raise InputError, with the nearest, otherwise."""
    if not isinstance(value, str):
        raise InputError(f"{short(value)} is not a text")
    if value not in names:
        raise InputError(str(unknown("", value, names)).lstrip())
    return value


def _level(word: str) -> bool:
    if word not in LEVELS:
        raise InputError(f"{word!r} is neither on nor off")
    return LEVELS[word]


def _whole(word: str, base: int = 10) -> int:
    try:
        return numbers.whole(word, base)
    except ValueError:
        raise InputError(f"{short(word)} is not a whole number") from None


def read_identifier(value: object) -> int:
    """Return an identifier of 11 bits; raise InputError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= COB_ID_MASK:
        raise InputError(f"{short(value)} is not an identifier from 0 to 0x{COB_ID_MASK:X}")
    return value


Identifier = Annotated[int, read_as(read_identifier, {"type": "integer", "minimum": 0, "maximum": COB_ID_MASK})]


def _read_frames(value: object) -> str | tuple[int, ...]:
    """Read the name of frames, or a list of identifiers."""
    if isinstance(value, list):
        return tuple(sorted(set(map(read_identifier, value))))
    return known_name(value, FRAMES)


def _read_bytes(value: object) -> bytes:
    """Read the data of a frame in hexadecimal digits."""
    if not isinstance(value, str):
        raise InputError(f"{short(value)} is not a text")
    try:
        data = bytes.fromhex(value)
    except ValueError:
        raise InputError(f"{value!r} is not bytes in hexadecimal digits, such as '0f 00'") from None
    if len(data) > DATA_BYTES_MAX:
        raise InputError(f"{len(data)} bytes are more than {DATA_BYTES_MAX}")
    return data


def whole_number(least: float = -inf, most: float = inf) -> ReadBy:
    """Return the annotation of a whole number from `least` to `most`; seeds may be long."""

    def read(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise InputError(f"{short(value)} is not a whole number")
        if value < least:
            raise InputError(f"{short(value)} is below {least:g}")
        if abs(value) > most:
            raise InputError(f"{short(value)} is not a whole number up to {most}")
        return value

    limits = {"minimum": least, "maximum": most}
    return read_as(read, {"type": "integer"} | {name: limit for name, limit in limits.items() if isfinite(limit)})


def _wired_input(robot: "Robot", name: str, _values: Mapping[str, Any]) -> Any:
    from steptwin.host.operate.inputs_outputs import wired_input  # slow to import, and not needed for help

    return wired_input(robot, name)


def _input_name(robot: "Robot", bit: DigitalInput, fault: Any) -> str | None:
    from steptwin.host.operate.inputs_outputs import wired_inputs

    return next((name for name, place in wired_inputs(robot).items() if place == (fault.axis, bit)), None)


def _fitted_switch(robot: "Robot", name: str, values: Mapping[str, Any]) -> DigitalInput:
    from steptwin.host.operate.inputs_outputs import switches_of

    joint = values["joint"]
    fitted = switches_of(robot, robot.axis_index(joint))
    if name not in fitted:
        raise unknown(f"switch of {joint}", name, fitted)
    return fitted[name]


def _ids_of(robot: "Robot", frames: str | tuple[int, ...], values: Mapping[str, Any]) -> tuple[int, ...]:
    joint = values["joint"]
    if joint is None:
        return cob_ids(robot, frames) if isinstance(frames, str) else frames
    axis = robot.axis_index(joint)
    if not isinstance(frames, str) or frames not in _NODES:
        raise InputError(f"joint: {joint} has no frames of its own among {frames}")
    return cob_ids(robot, frames, axis)


@dataclass(frozen=True, slots=True)
class ValueKind:
    """Reading and writing of a kind of value.

    Attributes:
        metavar: its placeholder in help.
        description: its form in JSON.
        of_word: converts a word, None for a missing key; raises InputError.
        hint: returns its type in a model of the request.
        meant: returns its meaning for a robot, from it and the request's other values; None: the value itself.
        written: returns a request's value from a field's value and the fault; None: the value itself.
    """

    metavar: str
    description: str
    of_word: Callable[[str], object]
    hint: Callable[[Key], Any] = lambda _: str
    meant: "Callable[[Robot, Any, Mapping[str, Any]], Any] | None" = None
    written: "Callable[[Robot, Any, Fault], Any] | None" = None


_FRAMES_SCHEMA: Final = {"anyOf": [{"enum": [*FRAMES]}, {"type": "array", "items": {"type": "integer"}}]}
_HOST: Final = "host"
_JOINT: Final = ValueKind(
    "JOINT",
    "name of a joint",
    str,
    meant=lambda robot, name, _: robot.axis_index(name),
    written=lambda robot, axis, _: robot.axis_names[axis],
)
_KINDS: Final[Mapping[KeyKind, ValueKind]] = {
    KeyKind.TRUTH: ValueKind("on|off", "true or false", _level, lambda _: bool),
    KeyKind.WHOLE: ValueKind(
        "N", "whole number", _whole, lambda key: Annotated[int, whole_number(key.least, key.most)]
    ),
    KeyKind.NUMBER: ValueKind(
        "NUMBER",
        "number",
        numbers.finite_number,
        lambda key: Annotated[float, Within(key.least, min(key.most, LARGEST), key.unit)],
    ),
    KeyKind.WORD: ValueKind("WORD", "word", str),
    KeyKind.JOINT: _JOINT,
    KeyKind.STATION: replace(_JOINT, metavar=f"JOINT|{_HOST}", of_word=lambda word: None if word == _HOST else word),
    KeyKind.INPUT: ValueKind("NAME", "name of an input", str, meant=_wired_input, written=_input_name),
    KeyKind.SWITCH: ValueKind(
        "|".join(SWITCHES),
        " or ".join(f"`{name}`" for name in SWITCHES),
        str,
        meant=_fitted_switch,
        written=lambda _robot, switch, _fault: next(name for name, bit in SWITCHES.items() if bit == switch),
    ),
    KeyKind.FRAMES: ValueKind(
        "FRAMES",
        "name of frames, or list of identifiers",
        lambda word: [_whole(each, 0) for each in word.split(",")] if word[:1].isdigit() else word,
        lambda _: Annotated[Any, read_as(_read_frames, _FRAMES_SCHEMA)],
        _ids_of,
    ),
    KeyKind.IDENTIFIER: ValueKind("ID", "identifier", lambda word: _whole(word, 0), lambda _: Identifier),
    KeyKind.BYTES: ValueKind(
        "HEX",
        f"up to {DATA_BYTES_MAX} bytes in hexadecimal digits",
        str,
        lambda _: Annotated[bytes, read_as(_read_bytes, {"type": "string"})],
        written=lambda _robot, data, _fault: data.hex(" "),
    ),
}


def kind_of(key: Key) -> ValueKind:
    """Return the reading and writing of a key's value."""
    assert key.kind is not None
    return _KINDS[key.kind]


def metavar(key: Key) -> str:
    """Return the placeholder of a key's value in help."""
    return key.metavar or "|".join(map(str, key.choices)) or kind_of(key).metavar


def description(key: Key) -> str:
    """Return the form of a key's value in JSON."""
    return " or ".join(f"`{each}`" for each in key.choices) or kind_of(key).description


def usage(do: str) -> str:
    """Return the words after a request's name in a command; optional ones are in brackets."""
    keys = keys_of(do).values()
    return " ".join(f"[{key.name}={metavar(key)}]" if key.optional else metavar(key) for key in keys)


# --- reading


@cache
def model_of(do: str, base: Any = FileTable) -> type[Any]:
    """Return the model of tables with `do`: keys of a base and of the fault."""
    keys: list[Any] = [("do", Literal[do])]
    for key in keys_of(do).values():
        hint = Literal[tuple(key.choices)] if key.choices else kind_of(key).hint(key)
        keys.append((key.name, hint | None, None) if key.optional else (key.name, hint))
    named = {"__doc__": f"{do}: {sentence(do)}."}
    return make_dataclass(f"{do} table", keys, bases=(base,), namespace=named, frozen=True, kw_only=True)


def read_request(robot: "Robot", request: Mapping[str, Any]) -> Fault | None:
    """Return the fault of a request; None if it only asks for the state of the machine.

    Raises:
        InputError: the request is unknown, has other keys or a value out of its range, or names something that the
            robot lacks.
    """
    findings = Findings()
    table = read_fault_table(request, findings)
    findings.raise_first()
    return fault_of(robot, table)


def read_fault_table(values: object, findings: Findings, base: Any = FileTable) -> Any:
    """Return a fault's table, or a part of it, read by its model; errors are added to the findings.

    Raises:
        InputError: it is no table, or its `do` is missing or unknown.
    """
    if not isinstance(values, dict):
        raise InputError(f"{short(values)} is not a table")
    if "do" not in values:
        raise InputError(f"do: is missing: one of {', '.join(REQUESTS)}")
    with prefixed("do: "):
        do = known_name(values["do"], REQUESTS)
    return read_model(model_of(do, base), values, findings)


def fault_of(robot: "Robot", table: Any) -> Fault | None:
    """Return the fault of a table for a robot; None for the state.

    Raises:
        InputError: the robot lacks what it names, or its values do not go together.
        UnreadError: a value of the table could not be read.
    """
    fault = REQUESTS[table.do]
    if fault is None:
        return None
    values = {name: getattr(table, name) for name in keys_of(table.do)}

    def meant(key: Key) -> Any:
        value = values[key.name]
        if value is None:
            return None
        if (find := kind_of(key).meant) is not None:
            return find(robot, value, values)
        return key.choices[value] if key.choices else key.to_field(value)

    try:
        return fault(
            **{
                name: keys.join(*map(meant, keys.keys))
                for name, keys in fault.by_field().items()
                if any(values[key.name] is not None for key in keys.keys)
            }
        )
    except ValueError as error:
        raise InputError(str(error)) from error


# --- writing


def request_of(robot: "Robot", fault: Fault) -> dict[str, Any]:
    """Return the request for a fault; `read_request` converts it back."""
    usual = {each.name: each.default for each in fields(fault) if each.default is not MISSING}
    values: dict[str, Any] = {}
    for name, keys in fault.by_field().items():
        value = getattr(fault, name)
        for key, part in zip(keys.keys, keys.split(value), strict=True):
            if not key.optional or key.written or value != usual.get(name):
                values |= _written_values(robot, fault, key, part)
    keys_of_all = fault.keys()
    if any(key.kind is KeyKind.INPUT and values[name] is None for name, key in keys_of_all.items()):
        return {"do": type(fault).__name__, **asdict(fault)}  # the robot's file does not have the sensor
    return {"do": fault.do} | {key: values[key] for key in keys_of_all if values.get(key) is not None}


def _written_values(robot: "Robot", fault: Fault, key: Key, value: Any) -> dict[str, Any]:
    """Return a request's values of a key and of the keys that go with it."""
    if key.kind is KeyKind.WORD:
        return {key.name: next(word for word, each in key.choices.items() if each == value)}
    if value is None:
        return {}
    if key.kind is KeyKind.FRAMES:
        ids = tuple(sorted(set(value)))
        name, axis = name_of(robot, ids) or (list(ids), None)
        return {key.name: name} | ({} if axis is None else {"joint": robot.axis_names[axis]})
    write = kind_of(key).written
    return {key.name: key.of_field(value) if write is None else write(robot, value, fault)}


# --- words of a command


def request_of_words(words: Sequence[str]) -> tuple[str, dict[str, object]]:
    """Return the kind of request in a command's words, and its keys besides `do`.

    A word such as `rate=0.1` is the value of this key; the other words are those of the remaining keys, in order.

    Raises:
        InputError: the request is unknown, or values are missing, too many, unknown, or of another kind.
    """
    if not words:
        raise InputError(f"WHAT is missing: {', '.join(INJECTED)}")
    do, *rest = words
    if do not in INJECTED:
        raise unknown("WHAT", do, INJECTED)
    keys, given = keys_of(do), _by_key(do, rest)
    if any(name not in given for name, key in keys.items() if not key.optional):
        raise _other_usage(do, rest)
    values = {}
    for name, word in given.items():
        with prefixed(f"{name}: "):
            values[name] = kind_of(keys[name]).of_word(word)
    return do, {name: value for name, value in values.items() if value is not None}


def _by_key(do: str, words: Sequence[str]) -> dict[str, str]:
    """Return the words by key."""
    keys = keys_of(do)
    named: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if equals and key not in keys:
            raise unknown(f"key of {do}", key, keys)
        if equals and key in named:
            raise InputError(f"{key}: is given twice")
        if equals:
            named[key] = value
    alone = [word for word in words if "=" not in word]
    free = [key for key in keys if key not in named]
    if len(alone) > len(free):
        raise _other_usage(do, words)
    return dict(zip(free, alone, strict=False)) | named


def _other_usage(do: str, words: Sequence[str]) -> InputError:
    return InputError(f"after {do}: {usage(do) or 'nothing'}, not {' '.join(words) or 'nothing'}")


def end_of(do: str, values: Mapping[str, object]) -> str | None:
    """Return how the fault of a request ends, as text; None if it is over at once, or ends another one."""
    fault = REQUESTS[do]
    return None if fault is None else fault.ends_by(values)


# --- control port

names: Final = tuple(FAULTS)
"""Values of `do`: this module is the feature's `ControlRequests`."""


def answer(board: "LiveBoard", request: Mapping[str, Any]) -> Mapping[str, Any]:
    """Execute a request; the machine's state has the result."""
    fault = read_request(board.robot, request)
    if fault is not None:
        board.operate(fault)
    return {}


def written(robot: "Robot", operation: "Operation") -> Mapping[str, Any] | None:
    """Return the request for a fault; None for another operation."""
    return request_of(robot, operation) if isinstance(operation, Fault) else None
