"""A dimension of a mechanism as a field of a dataclass, with its meaning for readers of files and pages."""

from dataclasses import MISSING, Field, field, fields
from typing import Any


def dimension(meaning: str, usual: object, default: object = MISSING) -> Any:
    """Return a dataclass field; `usual` is the value in a new robot file, `default` the value if the key is missing."""
    metadata = {"meaning": meaning, "usual": usual}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


def dimensions(geometry: type[Any]) -> dict[str, Field[Any]]:
    """Return the dimensions of a mechanism's dataclass by name."""
    return {dimension.name: dimension for dimension in fields(geometry)}


def meaning(dimension: Field[Any]) -> str:
    """Return what a dimension is, in a few words."""
    return str(dimension.metadata["meaning"])
