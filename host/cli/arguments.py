"""Arguments that several commands share."""

from typing import Annotated

import typer

from host.errors import InputError

RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="A robot's name, as `steptwin robots` lists them, or the path of its .toml file."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, everything else on stderr.")]

_LARGEST = 1e9

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""For commands whose arguments may be negative numbers, which otherwise look like options."""


def joint_values(texts: list[str], names: tuple[str, ...], what: str) -> list[float]:
    """Joint positions from the command line.

    Raises:
        InputError: a text is no number, or there are too few or too many.
    """
    values = [finite_number(text, what) for text in texts]
    if len(values) != len(names):
        raise InputError(f"{what}: {len(values)} values for the {len(names)} joints {' '.join(names)}")
    return values


def finite_number(text: str, what: str) -> float:
    """A number of a size that machines have; InputError for anything else."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{what}: '{text}' is not a number") from None
    if not abs(value) <= _LARGEST:
        raise InputError(f"{what}: {text} is not a finite number up to {_LARGEST:g}")
    return value


def name_value_pairs(texts: list[str]) -> dict[str, str]:
    """NAME=VALUE texts as a mapping; the last one of a name counts."""
    pairs = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator:
            raise InputError(f"'{text}' is not of the form NAME=VALUE")
        pairs[name.strip()] = value.strip()
    return pairs
