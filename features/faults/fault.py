"""Base of every fault of a machine, its bus or its host: data that describes itself.

A fault is one class in `kinds/`, its row of the registry. Its docstring begins with its sentence. Its fields are the
keys of a scenario's [[fault]] and of requests. `apply` and `undo` execute it, `reactions` documents the machine's
reaction. Scenarios, the control port, `steptwin inject`, campaigns, reports, the judgement and the docs use nothing
else.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from enum import Enum, auto
from functools import cache
from inspect import cleandoc
from math import inf
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, get_args

from steptwin.emulator import operations
from steptwin.emulator.board.environment import BoardEnvironment
from steptwin.features.faults.reaction import Documented

if TYPE_CHECKING:
    from steptwin.features.faults.engine import Engine
    from steptwin.features.faults.moment import Moment
    from steptwin.host.client.control_client import ControlState


class KeyKind(Enum):
    """Kinds of values in requests; some stand for a part of the robot."""

    TRUTH = auto()
    WHOLE = auto()
    NUMBER = auto()
    WORD = auto()
    """One of the key's `choices`."""
    JOINT = auto()
    STATION = auto()
    """A joint for its board; commands also accept `host`, which leaves the key out."""
    INPUT = auto()
    """Name of an input of the robot's file: it stands for its axis and bit."""
    SWITCH = auto()
    """Name of a switch of the request's joint."""
    FRAMES = auto()
    """Name of frames, of the request's joint if it has one, or a list of identifiers."""
    IDENTIFIER = auto()
    BYTES = auto()
    """The data of a frame."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of requests.

    Attributes:
        name: the key; by default the name of its field.
        kind: kind of its value; by default that of its field's type.
        metavar: placeholder of the value in the help of commands; by default that of its kind.
        least: lowest number, in the request's unit.
        most: highest number.
        unit: unit of the number, for messages.
        parts: number of field units in that unit; None: the field has the number itself.
        choices: allowed values, and the field's value for each; by default those of the field's enumeration.
        optional: True if requests may leave it out; always for a field with a default.
        written: True if it is written even with the field's default.
    """

    name: str = ""
    kind: KeyKind | None = None
    metavar: str = ""
    least: float = -inf
    most: float = inf
    unit: str = ""
    parts: int | None = None
    choices: Mapping[Any, Any] = field(default_factory=dict)
    optional: bool = False
    written: bool = False

    def to_field(self, value: Any) -> Any:
        """Convert a request's value to the field's."""
        return value if self.parts is None or value is None else round(value * self.parts)

    def of_field(self, value: Any) -> Any:
        """Convert the field's value to a request's."""
        return value if self.parts is None or value is None else value / self.parts

    def of(self, owner: Field[Any]) -> "Key":
        """Return the key completed by its field."""
        own = replace(self, name=self.name or owner.name, optional=self.optional or owner.default is not MISSING)
        if self.kind is not None:
            return own
        hint = getattr(owner.type, "__origin__", owner.type)
        plain = next(each for each in get_args(hint) or (hint,) if each is not NoneType)
        choices = self.choices or ({each.value: each for each in plain} if issubclass(plain, Enum) else {})
        if any(isinstance(each, str) for each in choices):
            return replace(own, kind=KeyKind.WORD, choices=choices)
        return replace(own, kind=KeyKind.NUMBER if self.parts else _KINDS_OF_TYPES[plain])


_KINDS_OF_TYPES: Final = {bool: KeyKind.TRUTH, int: KeyKind.WHOLE, float: KeyKind.NUMBER}


@dataclass(frozen=True, slots=True)
class Keys:
    """Keys of one field, or common keys of several fields.

    Attributes:
        keys: the keys.
        join: returns the field's value from those of the keys, None for a missing one; raises ValueError.
        split: returns the values of the keys, None for one that the request leaves out.
    """

    keys: tuple[Key, ...]
    join: Callable[..., Any] = lambda value: value
    split: Callable[[Any], tuple[Any, ...]] = lambda value: (value,)


def _read_keys(fault: Any) -> dict[str, Keys]:
    keys = {}
    for each in fields(fault):
        given = getattr(each.type, "__metadata__", (Key(),))[0]  # of Annotated; else one key with the field's name
        keys[each.name] = given if isinstance(given, Keys) else Keys((given.of(each),))
    return keys


_by_field: Final[Callable[[Any], dict[str, Keys]]] = cache(_read_keys)


@dataclass(frozen=True, slots=True)
class Fault(operations.Operation):
    """A fault, or its repair.

    Raises:
        ValueError: a value is outside the limits of its key.
    """

    do: ClassVar[str]
    """Its name in requests."""
    reactions: ClassVar[Sequence[Documented]]
    """Documented reactions: the first row whose condition holds at the fault's beginning applies."""
    over: ClassVar[str] = "it is over at once"
    """Why nothing ends it, if it has no `undo`."""
    ends: ClassVar[str] = ""
    """How it ends, with `{key}` for the value of a key; empty if the state of the machine shows it."""
    ended_by: ClassVar[Mapping[str, Any]] = {}
    """Values of keys with which the same request ends the fault; None: the key is left out."""
    place_fields: ClassVar[Sequence[str]] = ("axis",)
    """Fields of its place, if it has them: a later fault in the same place replaces an earlier one."""
    takes_down: ClassVar[bool] = False
    """True if it takes boards down. Their drivers are not read before, since it cuts off pulses that have begun."""

    def __post_init__(self) -> None:
        for name, each in self.by_field().items():
            key, value = each.keys[0], getattr(self, name)
            if key.kind not in (KeyKind.WHOLE, KeyKind.NUMBER) or key.choices or value is None:
                continue
            if not key.least <= key.of_field(value) <= key.most:
                raise ValueError(f"{name} {value:.10g} {_outside(key)}")

    # --- names

    @classmethod
    def sentence(cls) -> str:
        """Return its description: the summary of its docstring, in Markdown."""
        text = " ".join(cleandoc(cls.__doc__ or "").partition("\n\n")[0].split()).removesuffix(".")
        return text[:1].lower() + text[1:]

    @classmethod
    def by_field(cls) -> dict[str, Keys]:
        """Return the keys of each field."""
        return _by_field(cls)

    @classmethod
    def keys(cls) -> dict[str, Key]:
        """Return the keys of requests by name, required ones first."""
        keys = {key.name: key for each in cls.by_field().values() for key in each.keys}
        return dict(sorted(keys.items(), key=lambda item: item[1].optional))

    @classmethod
    def shown(cls, _state: "ControlState", _values: Mapping[str, Any]) -> str:
        """Return a line about a request with these values from the state of a board; empty for none."""
        return ""

    # --- beginning and end

    def check_motors(self, *, turning: bool) -> None:
        """Raise InputError for a fault that needs turning motors, if none turn with the boards."""

    def undo(self, _before: BoardEnvironment) -> "Fault | None":
        """Return the fault that ends this one, from the environment before it; None if it cannot end."""
        return None

    def begin(self, engine: "Engine", *, ends: bool) -> None:  # noqa: ARG002
        """Begin on the machine of a scenario; `ends` is True if the time of its end is known."""
        self.apply(engine.target.simulation, 0)

    def end(self, engine: "Engine") -> None:
        """End on the machine of a scenario."""

    @property
    def strikes(self) -> bool:
        """True if it strikes when it begins; False if it waits for frames."""
        return True

    @property
    def lasts_s(self) -> float | None:
        """Duration after which it ends by itself; None if it does not."""
        return None

    def why_endless(self) -> str | None:
        """Why a scenario cannot end it; None if it can."""
        return self.over if type(self).undo is Fault.undo else None

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        """Return how the fault of a request with these values ends; None if the state of the machine shows it."""
        return cls.ending_request(values) if cls.ended_by else cls.ends.format(**values) or None

    @classmethod
    def ending_request(cls, values: Mapping[str, Any]) -> str | None:
        """Return the request that ends the fault, by `ended_by`; None if the values are those of its end already."""
        if all(values.get(key) == value for key, value in cls.ended_by.items()):
            return None
        needed = (cls.ended_by.get(name, values.get(name)) for name, key in cls.keys().items() if not key.optional)
        return f"`{' '.join((cls.do, *('off' if value is False else str(value) for value in needed)))}`"

    # --- reaction

    def documented(self, moment: "Moment") -> Documented:
        """Return the documented reaction to the fault at this moment."""
        return next(row for row in self.reactions if row.when(self, moment))

    def concerned(self, boards: Sequence[int]) -> list[int]:
        """Return the axes that must report the fault, from the number of each axis' board."""
        return list(range(len(boards)))


def _outside(key: Key) -> str:
    low, high = (each if key.parts is None else round(each * key.parts) for each in (key.least, min(key.most, 1e18)))
    return f"is not from {low:.10g} to {high:.10g}" if key.most < inf else f"is not {low:.10g} or more"


@dataclass(frozen=True, slots=True)
class MachineFault(Fault):
    """A fault of a simulation's boards, or of their bus, that is applied in one instant."""

    @property
    def changes(self) -> tuple[object, ...]:
        """Identify its target, such as the supply or the wire of an axis."""
        return (type(self), *(getattr(self, name, None) for name in self.place_fields))

    def begin(self, engine: "Engine", *, ends: bool) -> None:  # noqa: ARG002
        engine.change(self)

    def end(self, engine: "Engine") -> None:
        engine.restore(self)

    def concerned(self, boards: Sequence[int]) -> list[int]:
        place = self.place
        return [axis for axis, board in enumerate(boards) if place is None or board == boards[place]]


@dataclass(frozen=True, slots=True)
class BoardFault(MachineFault, operations.BoardOperation):
    """A fault of the machine of one board."""


JOINT: Final = Key("joint", KeyKind.JOINT)


@dataclass(frozen=True, slots=True)
class AxisFault(BoardFault, operations.AxisOperation):
    """A fault at the connector of one axis."""

    axis: Annotated[int, JOINT]

    def concerned(self, _boards: Sequence[int]) -> list[int]:
        return [self.axis]
