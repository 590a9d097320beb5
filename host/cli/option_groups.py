"""Options that belong together: a dataclass in a command's signature stands for an option for each of its fields."""

from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from inspect import Parameter, Signature, signature
from typing import Any


def with_groups(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer is to see it: an option for each field of the dataclasses among its parameters.

    The command's own options come first. A group may have a group among its fields; an option that the command or the
    outer group has itself is left to that one.
    """
    parameters = signature(function).parameters
    groups = {name: each.annotation for name, each in parameters.items() if is_dataclass(each.annotation)}
    if not groups:
        return function
    own = {name: each.replace(kind=Parameter.KEYWORD_ONLY) for name, each in parameters.items() if name not in groups}
    options = dict(own)
    for group in groups.values():
        for field in _options(group):
            options.setdefault(field.name, _parameter(field))

    def grouped(**values: Any) -> None:
        given = {name: values.pop(name) for name in own}
        function(**given, **{name: _made(group, values) for name, group in groups.items()})

    grouped.__name__, grouped.__module__, grouped.__doc__ = function.__name__, function.__module__, function.__doc__
    grouped.__signature__ = Signature(list(options.values()))  # type: ignore[attr-defined]
    return grouped


def _options(group: Any) -> Iterator[Field[Any]]:
    """Yield the fields of a group that are options, then those of the groups in it."""
    yield from (field for field in fields(group) if not is_dataclass(field.type))
    for field in fields(group):
        if is_dataclass(field.type):
            yield from _options(field.type)


def _parameter(field: Field[Any]) -> Parameter:
    default = Parameter.empty if field.default is MISSING else field.default
    return Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=field.type)


def _made(group: Any, values: dict[str, Any]) -> Any:
    """Take the values of a group's options out of those of a command line, and make the group of them."""
    made = {field.name: values.pop(field.name) for field in fields(group) if field.name in values}
    inner = {field.name: _made(field.type, values) for field in fields(group) if is_dataclass(field.type)}
    return group(**made, **inner)
