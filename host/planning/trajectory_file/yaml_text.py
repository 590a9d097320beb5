"""Read the one document of a YAML text, its scalars as JSON would have them.

Every scalar that is written as a number is one, and any other is a text: YAML 1.1 would take 1e-05, which Python
writes, for a text and `on` for a truth. Aliases are refused before anything is built, since a few of them, one within
the other, stand for millions of values.
"""

import re
from collections.abc import Iterator
from typing import Final

from steptwin.host.common.bad_input import shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table

YAML: Final = "YAML mapping"
"""What messages call a table of such a text."""
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_DEEP_MAX: Final = 16
"""Lists and mappings within one another: a value of a planned trajectory lies ten deep."""


def yaml_table(text: str) -> Table:
    """Return the mapping of a YAML text, whose other documents are empty, as behind the last line of `rostopic echo`.

    Raises:
        InputError: the text is not YAML, is nested too deeply, has an alias, or has no or several documents.
    """
    import yaml

    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # libyaml reads ten times as fast, where PyYAML has it
    try:
        starts = list(_checked_starts(text, loader))
        documents = list(yaml.load_all(text, Loader=loader))
    except yaml.YAMLError as error:
        raise InputError(f"is not YAML: {_in_a_line(error)}") from error
    full = [(line, document) for line, document in zip(starts, documents, strict=True) if document]
    if len(full) > 1:
        lines = ", ".join(str(line) for line, _ in full[:_SHOWN])
        more = ", ..." if len(full) > _SHOWN else ""
        raise InputError(f"has {len(full)} messages, which begin at lines {lines}{more}: keep the one to be run")
    return Table(_with_numbers(full[0][1]) if full else {}, YAML)


_SHOWN: Final = 3


def _checked_starts(text: str, loader: type) -> Iterator[int]:
    """Yield the line at which each document begins; raise InputError for an alias or too deep a nesting."""
    import yaml

    deep = 0
    for event in yaml.parse(text, Loader=loader):
        line = event.start_mark.line + 1
        match event:
            case yaml.AliasEvent(anchor=anchor):
                raise InputError(
                    f"line {line}: *{shortened(anchor)} is an alias: write out the value that it stands for"
                )
            case yaml.CollectionStartEvent():
                deep += 1
                if deep > _DEEP_MAX:
                    raise InputError(f"line {line}: more than {_DEEP_MAX} lists and mappings within one another")
            case yaml.CollectionEndEvent():
                deep -= 1
            case yaml.DocumentStartEvent():
                yield line


def _in_a_line(error: Exception) -> str:
    """Return what a parser says, with the line, in one line."""
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
    place = f"line {mark.line + 1}: " if mark else ""
    return place + " ".join(str(problem or error).split())


def _with_numbers(value: object) -> object:
    """Return a document of texts with a number wherever one is written."""
    match value:
        case dict():
            return {key: _with_numbers(each) for key, each in value.items()}
        case list():
            return [_with_numbers(each) for each in value]
        case str() if _NUMBER.fullmatch(value):
            return float(value)
    return value
