"""What every harm is: something that goes wrong with a machine, its bus or its host, as data that describes itself.

The metadata of a field say by which keys a request names it: scenarios, the control port, `steptwin inject`, campaigns
and the docs read nothing else. So a new harm is one dataclass in this folder, a row of its documented reaction in
`features/faults/`, and a scenario of `features/campaigns/nightly.toml`, which has every harm.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from enum import Enum, auto
from math import inf
from typing import Any, ClassVar, Final

from steptwin.emulator import operations
from steptwin.emulator.board.environment import BoardEnvironment


class KeyKind(Enum):
    """The kinds of values that requests have; some mean a part of the robot, which the host finds."""

    TRUTH = auto()
    WHOLE = auto()
    NUMBER = auto()
    WORD = auto()
    """A name of the key's `choices`."""
    JOINT = auto()
    STATION = auto()
    """A joint, whose board is meant; in a command also `host`, which is a key left out."""
    INPUT = auto()
    """Name of an input of the robot's file: its axis and its bit."""
    SWITCH = auto()
    """Name of a switch that the request's joint has."""
    FRAMES = auto()
    """Name of frames, of the request's joint if it has one, or a list of identifiers."""
    IDENTIFIER = auto()
    BYTES = auto()
    """The data of a frame."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of requests.

    Attributes:
        name: the key.
        kind: kind of its value.
        metavar: stands for the value in the help of commands; by default that of its kind.
        least: smallest number, in the request's unit.
        most: greatest number.
        unit: unit of the number, for messages.
        parts: parts of that unit in which the field counts; None: the field has the number itself.
        choices: the only values, and what each is in the field.
        optional: whether requests may go without it.
        told: whether it is written even if the field has its default.
    """

    name: str
    kind: KeyKind
    metavar: str = ""
    least: float = -inf
    most: float = inf
    unit: str = ""
    parts: int | None = None
    choices: Mapping[Any, Any] = field(default_factory=dict)
    optional: bool = False
    told: bool = False

    def to_field(self, value: Any) -> Any:
        """Return a value of a request as the field has it."""
        return value if self.parts is None or value is None else round(value * self.parts)

    def of_field(self, value: Any) -> Any:
        """Return a value of the field as requests have it."""
        return value if self.parts is None or value is None else value / self.parts


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of a field: what makes its value of theirs, and theirs of it."""

    keys: tuple[Key, ...]
    join: Callable[..., Any]
    split: Callable[[Any], tuple[Any, ...]]


def keyed(
    *keys: Key,
    join: Callable[..., Any] = lambda value: value,
    split: Callable[[Any], tuple[Any, ...]] = lambda value: (value,),
) -> dict[str, Keys]:
    """Return the metadata of a field with these keys.

    Args:
        keys: the keys.
        join: makes the field's value of those of the keys, None for one that is missing; raises ValueError.
        split: returns the values of the keys, None for one that the request goes without.
    """
    return {_METADATA: Keys(keys, join, split)}


_METADATA: Final = "keys"


@dataclass(frozen=True, slots=True)
class Harm(operations.Operation):
    """Something that goes wrong, or is repaired.

    Raises:
        ValueError: a value is outside the limits of its key.
    """

    do: ClassVar[str]
    """Its name in requests."""
    does: ClassVar[str]
    """What it does, in words; Markdown."""
    over: ClassVar[str] = "it is over at once"
    """Why nothing ends it, if it has no `undo`."""
    ends: ClassVar[str] = ""
    """What else than its time ends it, in words, with the names of keys for their values; empty: the state shows it."""
    end_values: ClassVar[Mapping[str, Any]] = {}
    """Values of keys, None for one left out, by which a request is itself the end of such a harm."""

    def __post_init__(self) -> None:
        for name, each in self.by_field().items():
            key, value = each.keys[0], getattr(self, name)
            if key.kind not in (KeyKind.WHOLE, KeyKind.NUMBER) or value is None:
                continue
            if not key.least <= key.of_field(value) <= key.most:
                raise ValueError(f"{name} {value:.10g} {_outside(key)}")

    @classmethod
    def by_field(cls) -> dict[str, Keys]:
        """Return the keys of each field that has any."""
        return {each.name: each.metadata[_METADATA] for each in fields(cls) if each.metadata}

    @classmethod
    def keys(cls) -> dict[str, Key]:
        """Return the keys of requests by their names: those that are needed, then the others."""
        keys = {key.name: key for each in cls.by_field().values() for key in each.keys}
        return dict(sorted(keys.items(), key=lambda item: item[1].optional))

    def why_endless(self) -> str | None:
        """Return why nothing ends it, in words; None if there is something that does."""
        return self.over if type(self).undo is Harm.undo else None

    def undo(self, _before: BoardEnvironment) -> "Harm | None":
        """Return the harm that ends this one, before which the machine was so; None if it has no end."""
        return None

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        """Return what else than its time ends the harm of a request with these values; None if the state shows it."""
        if not cls.ends or any(values.get(key) == value for key, value in cls.end_values.items()):
            return None
        return cls.ends.format(**values)


def _outside(key: Key) -> str:
    low, high = (each if key.parts is None else round(each * key.parts) for each in (key.least, min(key.most, 1e18)))
    return f"is not from {low:.10g} to {high:.10g}" if key.most < inf else f"is not {low:.10g} or more"


@dataclass(frozen=True, slots=True)
class MachineHarm(Harm):
    """A harm to the boards of a simulation, or to their bus, that is over as soon as it is done."""


@dataclass(frozen=True, slots=True)
class BoardHarm(MachineHarm, operations.BoardOperation):
    """A harm to the machine of one board."""


JOINT: Final = Key("joint", KeyKind.JOINT)


@dataclass(frozen=True, slots=True)
class AxisHarm(BoardHarm, operations.AxisOperation):
    """A harm at the connector of one axis."""

    axis: int = field(metadata=keyed(JOINT))
