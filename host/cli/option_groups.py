"""Options that belong together: a dataclass in a command's signature stands for an option for each of its fields."""

from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def with_groups(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer is to see it: an option for each field of the dataclasses among its parameters."""
    groups: dict[str, Any] = {name: group for name, group in function.__annotations__.items() if is_dataclass(group)}
    if not groups:
        return function
    parameters: list[Parameter] = []
    for parameter in signature(function).parameters.values():
        if parameter.name in groups:
            parameters += _options(groups[parameter.name])
        else:
            parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY))

    def grouped(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(**{field.name: values.pop(field.name) for field in fields(group)})
        function(**values)

    grouped.__name__, grouped.__module__, grouped.__doc__ = function.__name__, function.__module__, function.__doc__
    grouped.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return grouped


@cache  # to evaluate the types takes time
def _options(group: Any) -> list[Parameter]:
    """Return a parameter for each field of a dataclass, with its type and its default."""
    types = get_type_hints(group, include_extras=True)
    return [
        Parameter(
            field.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if field.default is MISSING else field.default,
            annotation=types[field.name],
        )
        for field in fields(group)
    ]
