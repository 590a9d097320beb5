"""Options that belong together: a dataclass in a command's signature stands for an option for each of its fields.

The type of a field holds typer's description of its option. A field of the emulated machine's options has a spelling
instead, from which both are made; its value is read from the text here.
"""

from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, Final, NamedTuple, get_origin

import typer

from steptwin.host.cli.arguments import naming_options
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

MACHINE_PANEL: Final = "Emulated machine"
"""Title of the group of options, in a command's help, that only an emulated machine has."""


class Without(NamedTuple):
    """Mark of a group, in `Annotated`: fields that are no options here and keep their defaults."""

    names: tuple[str, ...]


class _Group(NamedTuple):
    """A dataclass whose fields are options, and those that are none here."""

    made: Any
    without: tuple[str, ...]

    @classmethod
    def of(cls, annotation: Any) -> "_Group | None":
        """Return the group that an annotation stands for; None if it is the type of one option."""
        if get_origin(annotation) is Annotated and is_dataclass(annotation.__origin__):
            return cls(annotation.__origin__, annotation.__metadata__[0].names)
        return cls(annotation, ()) if is_dataclass(annotation) else None

    @property
    def inner(self) -> "dict[str, _Group]":
        """The groups among the fields, by name."""
        return {field.name: group for field in fields(self.made) if (group := _Group.of(field.type))}

    @property
    def own(self) -> dict[str, Field[Any]]:
        """The fields that are options, by name."""
        without = {*self.without, *self.inner}
        return {field.name: field for field in fields(self.made) if field.name not in without}

    def options(self) -> Iterator[Field[Any]]:
        """Yield the fields that are options, then those of the groups among the fields."""
        yield from self.own.values()
        for group in self.inner.values():
            yield from group.options()

    def make(self, values: dict[str, Any]) -> Any:
        """Take the values of the options out of those of a command line, and make an object of them."""
        given = {name: _read(field, values.pop(name)) for name, field in self.own.items()}
        made = {name: value for name, value in given.items() if value is not MISSING}
        return self.made(**made, **{name: group.make(values) for name, group in self.inner.items()})


def with_groups(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer is to see it: its own options, then an option for each field of its groups."""
    parameters = signature(function).parameters
    groups = {name: group for name, each in parameters.items() if (group := _Group.of(each.annotation))}
    if not groups:
        return function
    own = [each.replace(kind=Parameter.KEYWORD_ONLY) for name, each in parameters.items() if name not in groups]
    options = [_parameter(field) for group in groups.values() for field in group.options()]

    def grouped(**values: Any) -> None:
        made = {name: group.make(values) for name, group in groups.items()}
        function(**values, **made)

    grouped.__name__, grouped.__module__, grouped.__doc__ = function.__name__, function.__module__, function.__doc__
    grouped.__signature__ = Signature([*own, *options])  # type: ignore[attr-defined]
    return grouped


def given_options(group: Any) -> list[str]:
    """Return the names, on the command line, of the options of a group that differ from their defaults."""
    kind = _Group(type(group), ())
    given = [_name(field) for field in kind.own.values() if getattr(group, field.name) != field.default]
    return given + [name for inner in kind.inner for name in given_options(getattr(group, inner))]


def _name(field: Field[Any]) -> str:
    if spelling := field.metadata.get(SPELLING):
        return str(spelling.option)
    name = field.type.__metadata__[0].default  # type: ignore[union-attr]
    return name if isinstance(name, str) else f"--{field.name.replace('_', '-')}"  # typer keeps the first name there


def _parameter(field: Field[Any]) -> Parameter:
    spelling: Spelling | None = field.metadata.get(SPELLING)
    if spelling is None:
        default = Parameter.empty if field.default is MISSING else field.default
        return Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=field.type)
    option = typer.Option(
        *filter(None, (spelling.option, spelling.short)),
        metavar=spelling.value or None,
        help=spelling.says,
        rich_help_panel=MACHINE_PANEL,
    )
    kind: Any = list[str] if spelling.repeatable else str
    annotation = Annotated[kind | None, option] if spelling.value else Annotated[bool, option]
    default = None if spelling.value else False
    return Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _read(field: Field[Any], given: Any) -> Any:
    """Return the value of an option; MISSING for an option with a spelling that is not given."""
    spelling: Spelling | None = field.metadata.get(SPELLING)
    if spelling is None:
        return given
    if given is None or given == []:
        return MISSING
    with naming_options(**{field.name: spelling.option}):
        return spelling.read(given)
