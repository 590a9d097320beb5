"""Describe the arguments and options of commands, and convert a command's signature for typer.

A command declares its own option as the default of a parameter, `option(...)`; an option of several commands is a type
in `arguments`. A group of options is a dataclass: in a command's signature it stands for one option a field. Options
of the emulated machine have spellings, and are given by `--machine KEY=VALUE`.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, Final, NamedTuple, get_args, get_origin

import typer

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.common.features import giving
from steptwin.host.twin.machine.machine_options import OF_FEATURES, SPELLING, Spelling

MACHINE_PANEL: Final = "Emulated machine"
"""Title of the box of an emulated machine's options in a command's help."""
MACHINE: Final = "machine"
"""Name of the option that changes the emulated machine."""
LIVE_PANEL: Final = "Live board"
"""Title of the box of a live board's options."""

LAST: Final = "as_json"
"""Parameter of the option that help shows last."""


@contextmanager
def naming_options(*parameters: str, **options: str) -> Iterator[None]:
    """Replace parameters by options in every error of the block, as `with_options`."""
    try:
        yield
    except StepTwinError as error:
        raise type(error)(with_options(str(error), *parameters, **options)) from error


def with_options(message: str, *parameters: str, **options: str) -> str:
    """Replace parameters by options in a message: `port=80` becomes `--port 80`.

    Args:
        message: the message.
        parameters: those with an option of the same name, such as `allow_remote` for `--allow-remote`.
        options: the option of each other parameter; one that ends in `=` takes its value without a space.
    """
    names = {name: _usual_name(name) for name in parameters} | options
    named = re.compile(rf"(?<!-)(?<!-o )\b({'|'.join(names)})=(True\b)?")  # an option in the text stays

    def option(found: re.Match[str]) -> str:
        name = names[found[1]]
        return name.removesuffix("=") if found[2] else name if name.endswith("=") else f"{name} "

    return named.sub(option, message)


def _usual_name(parameter: str) -> str:
    return f"--{parameter.replace('_', '-')}"


Reader = Callable[[Any, str], Any]
"""Converts an option's text, or texts; gets the option's name for the message of an InputError."""


class _Described(NamedTuple):
    """An argument or option.

    Attributes:
        told: further arguments for typer, besides names, type and default.
        names: its names; empty for the one of the parameter.
        read: converts its value; None if typer does, by the parameter's type.
        positional: True for an argument.
        alone: its value if given without one; empty if that is not allowed.
    """

    told: Mapping[str, Any]
    names: tuple[str, ...] = ()
    read: Reader | None = None
    positional: bool = False
    alone: str = ""


_DESCRIBED: Final = "described"
"""Key of a description in a field's metadata."""


def argument(value: str, says: str, default: object = None) -> Any:
    """Return a command's argument, as the default of its parameter: placeholder of the value, and meaning."""
    described = _Described({"metavar": value, "help": says}, positional=True)
    return field(default=default, metadata={_DESCRIBED: described})


def option(
    value: str,
    says: str,
    *names: str,
    default: object = None,
    read: Reader | None = None,
    alone: str = "",
    **told: Any,
) -> Any:
    """Return a command's option, as the default of its parameter or of a group's field.

    Args:
        value: placeholder of its value; empty for a switch.
        says: its effect.
        names: its names; by default that of the parameter.
        default: its value if it is not given, or a text to convert; MISSING if it is required.
        read: converts its value, if typer does not by the parameter's type.
        alone: its value if given without one; empty if that is not allowed.
        told: further arguments for typer.
    """
    described = _Described({"metavar": value or None, "help": says, **told}, names, read, alone=alone)
    return field(default=default, metadata={_DESCRIBED: described})


def switch(says: str, *names: str, **told: Any) -> Any:
    """Return an option without a value, which is off by default."""
    return option("", says, *names, default=False, **told)


def of_features(attribute: str) -> Any:
    """Return, as the default of a group's field, the options of features in one of their attributes."""
    return field(default=(), metadata={OF_FEATURES: attribute})


class Without(NamedTuple):
    """Mark of a group, in `Annotated`: fields that are no options here, and whether features' options are left out.

    Options for served boards only are left out, too.
    """

    names: tuple[str, ...]


@dataclass(frozen=True)
class _Group:
    """Options that make one object: its own, by field name, and those of the groups in it."""

    make: Callable[..., Any]
    own: Mapping[str, Field[Any]]
    inner: "Mapping[str, _Group]"

    @classmethod
    def of(cls, annotation: Any) -> "_Group | None":
        """Return the group of an annotation; None for the type of one option."""
        group = cls._of_class(annotation)
        if group is not None and any(SPELLING in each.metadata for each in group.own.values()):
            return _MachineGroup(group.make, group.own, group.inner)
        return group

    @classmethod
    def _of_class(cls, annotation: Any, *, served: bool = True) -> "_Group | None":
        """Return a group with an option for each field of a dataclass, of a served board or not."""
        made: Any = annotation
        without: tuple[str, ...] = ()
        if get_origin(annotation) is Annotated and is_dataclass(annotation.__origin__):
            made, without, served = annotation.__origin__, annotation.__metadata__[0].names, False
        if not isinstance(made, type) or not is_dataclass(made):
            return None
        members = (each for each in fields(made) if each.name not in without and _is_option(each, served=served))
        return cls.made_of(members, made, without, served=served)

    @classmethod
    def made_of(
        cls,
        members: Iterable[Field[Any]],
        make: Callable[..., Any],
        without: Collection[str] = (),
        *,
        served: bool = True,
    ) -> "_Group":
        """Return the group of these fields; `make`, a class or a function, makes its object of them."""
        found = {
            each.name: (each, cls._of_features(each, without, served=served) or cls.of(each.type)) for each in members
        }
        own = {name: each for name, (each, group) in found.items() if group is None}
        return cls(make, own, {name: group for name, (_, group) in found.items() if group})

    @classmethod
    def _of_features(cls, member: Field[Any], without: Collection[str], *, served: bool) -> "_Group | None":
        """Return the group of features' options for a field; None for a field of another kind."""
        if OF_FEATURES not in member.metadata:
            return None
        given = giving(member.metadata[OF_FEATURES])
        inner = {
            feature.name: cls._of_class(made(), served=served) for feature, made in given if feature.name not in without
        }
        return cls(lambda **made: tuple(made.values()), {}, {name: group for name, group in inner.items() if group})

    def options(self) -> Iterator[Field[Any]]:
        """Yield the fields that are options, then those of the groups in it."""
        yield from self.own.values()
        for group in self.inner.values():
            yield from group.options()

    def made(self, values: dict[str, Any]) -> Any:
        """Make the group's object; remove its options from the values of a command line."""
        own = {name: _read(each, values.pop(name)) for name, each in self.own.items()}
        return self.make(**own, **{name: group.made(values) for name, group in self.inner.items()})


class _MachineGroup(_Group):
    """Options of an emulated machine, which are keys of one option, `--machine KEY=VALUE`."""

    def _fields(self) -> dict[str, Field[Any]]:
        """Return the fields by their keys."""
        return {each.metadata[SPELLING].key: each for each in _Group.options(self)}

    def options(self) -> Iterator[Field[Any]]:
        """Yield the one option."""
        spelled: list[Spelling] = [each.metadata[SPELLING] for each in self._fields().values()]
        forms = [f"{each.key}={each.value}" if each.value else each.key for each in spelled]
        made: Field[Any] = option(
            "KEY=VALUE",
            "How the emulated machine differs from the robot's file, and what happens to it; repeatable"
            f" (docs/robot-files.md): {', '.join(forms)}.",
            f"--{MACHINE}",
            "-m",
            rich_help_panel=MACHINE_PANEL,
        )
        made.name, made.type = MACHINE, list[str] | None
        yield made

    def made(self, values: dict[str, Any]) -> Any:
        """Make the object from the texts of the one option; remove them from the values."""
        known = self._fields()
        given: dict[str, list[str]] = {key: [] for key in known}
        for text in values.pop(MACHINE) or []:
            key, equals, value = text.partition("=")
            if key not in known:
                raise unknown(f"--{MACHINE}", key, known)
            spelling = known[key].metadata[SPELLING]
            if bool(equals) != bool(spelling.value):
                form = f"needs a value: {key}={spelling.value}" if spelling.value else "takes no value"
                raise InputError(f"--{MACHINE} {text}: {form}")
            if given[key] and not spelling.repeatable:
                raise InputError(f"--{MACHINE} {text}: {key} is given twice")
            given[key].append(value)
        return super().made({known[key].name: _machine_value(known[key], texts) for key, texts in given.items()})


def _machine_value(each: Field[Any], texts: list[str]) -> Any:
    """Return the value to convert for a machine's option: its texts if repeatable, its text, or True."""
    spelling: Spelling = each.metadata[SPELLING]
    if not spelling.value:
        return bool(texts)
    return texts if spelling.repeatable or not texts else texts[0]


def with_groups(function: Callable[..., None]) -> tuple[Callable[..., None], dict[str, str]]:
    """Return a command for typer: its own options, then an option for each field of its groups.

    Also return the options that may stand without a value, and their values then.
    """
    group = _Group.made_of(map(_field_of, signature(function).parameters.values()), function)

    def grouped(**values: Any) -> None:
        group.made(values)

    grouped.__name__, grouped.__module__, grouped.__doc__ = function.__name__, function.__module__, function.__doc__
    options = sorted(group.options(), key=lambda each: each.name == LAST)
    grouped.__signature__ = Signature([_parameter(each) for each in options])  # type: ignore[attr-defined]
    return grouped, {name: alone for each in options if (alone := _described(each).alone) for name in _names(each)}


def given_options(group: Any) -> dict[str, Any]:
    """Return the options of a group that differ from their defaults, by name on the command line."""
    found = _Group.of(type(group))
    assert found is not None
    values = {name: getattr(group, name) for name in found.own}
    given = {_names(found.own[name])[0]: value for name, value in values.items() if value != found.own[name].default}
    for name in found.inner:
        inner = getattr(group, name)
        for each in inner if isinstance(inner, tuple) else (inner,):
            given |= given_options(each)
    return given


def _is_option(each: Field[Any], *, served: bool) -> bool:
    """Return whether a field of a dataclass is an option or a group, of a served board or not."""
    if SPELLING in each.metadata and each.metadata[SPELLING].served and not served:
        return False
    described = {SPELLING, _DESCRIBED, OF_FEATURES} & set(each.metadata)
    return bool(described) or get_origin(each.type) is Annotated or is_dataclass(each.type)


def _field_of(parameter: Parameter) -> Field[Any]:
    """Return a parameter of a command as a field; a default from `option` is one already."""
    default: Any = MISSING if parameter.default is Parameter.empty else parameter.default
    made: Field[Any] = default if isinstance(default, Field) else field(default=default)
    made.name, made.type = parameter.name, parameter.annotation
    return made


def _described(each: Field[Any]) -> _Described:
    """Return the description of an option, from its default, its type, or its spelling."""
    spelling: Spelling | None = each.metadata.get(SPELLING)
    if spelling is None:
        kind: Any = each.type
        described: _Described = (kind.__metadata__[0] if get_origin(kind) is Annotated else each).metadata[_DESCRIBED]
        return described

    def read(given: Any, name: str) -> Any:
        with naming_options(**{each.name: f"{name}="}):
            return spelling.read(given)

    return _Described({}, (f"--{MACHINE} {spelling.key}",), read if spelling.value else None)


def _names(each: Field[Any]) -> tuple[str, ...]:
    """Return the names of an option on the command line."""
    return _described(each).names or (_usual_name(each.name),)


def _parameter(each: Field[Any]) -> Parameter:
    """Return an option as a parameter for typer."""
    described, kind = _described(each), get_args(each.type)[0] if get_origin(each.type) is Annotated else each.type
    default = Parameter.empty if each.default is MISSING else each.default
    if described.read is not None:
        kind = str | None
        default = default if default is Parameter.empty or isinstance(default, str) else None
    names = () if described.positional else _names(each)
    told: Any = (typer.Argument if described.positional else typer.Option)(*names, **described.told)
    return Parameter(each.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, told])


def _read(each: Field[Any], given: Any) -> Any:
    """Return the value of an option."""
    read = _described(each).read
    if read is None:
        return given
    return each.default if given is None or given == [] else read(given, _names(each)[0])
