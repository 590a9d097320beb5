"""Render docs/api.md: the public names by subject, with their signatures and docstrings."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import steptwin
from docs.generate.commands import GeneratedPage
from docs.generate.markdown import table

_SECTION: Final = re.compile(r"^(Args|Attributes|Raises):\n((?:[ ]{4}.*\n?|\n)+)", re.MULTILINE)
_ENTRY: Final = re.compile(r"^ {4}(\S[^:\n]*): ((?:.|\n {8})*)", re.MULTILINE)
_DEFAULT_CHARS_MAX: Final = 40
_NOT_SHOWN: Final = (object, tuple, str, BaseException)
"""Bases whose members the page leaves out: Python documents them."""


@dataclass(frozen=True)
class _Docstring:
    """A docstring in Google's style.

    Attributes:
        text: what stands before the sections.
        sections: entries of each section, by its title.
    """

    text: str
    sections: dict[str, dict[str, str]]

    @classmethod
    def of(cls, thing: Any) -> "_Docstring":
        """Return the docstring of a function, a class or a property."""
        text = inspect.getdoc(thing) or ""
        sections = {
            title: {name: " ".join(words.split()) for name, words in _ENTRY.findall(entries)}
            for title, entries in _SECTION.findall(text)
        }
        return cls(_SECTION.sub("", text).strip(), sections)

    @property
    def first(self) -> str:
        """The first paragraph, in one line."""
        return " ".join(self.text.partition("\n\n")[0].split())


def signature(function: Any) -> str:
    """Return parameters with their defaults, without types; functions and large objects as defaults read `...`."""
    found = inspect.signature(function)
    parameters = [
        p.replace(annotation=p.empty, default=... if _is_large(p.default) else p.default)
        for p in found.parameters.values()
        if p.name != "self"
    ]
    return str(found.replace(parameters=parameters, return_annotation=found.empty)).replace("Ellipsis", "...")


def _is_large(default: Any) -> bool:
    return inspect.isfunction(default) or len(repr(default)) > _DEFAULT_CHARS_MAX


def public_members(cls: type) -> dict[str, str]:
    """Return the spelling of each public member of a class: of its own, and of bases that are not public."""
    members = {}
    for name in sorted({*dir(cls), *inspect.get_annotations(cls)}):
        if not name.startswith("_") and not any(hasattr(base, name) for base in _bases(cls)):
            value = getattr(cls, name, None)
            members[name] = (
                f".{name}{signature(value)}" if inspect.isfunction(value) or inspect.ismethod(value) else f".{name}"
            )
    return members


def _bases(cls: type) -> Iterator[type]:
    public = {getattr(steptwin, name) for name in steptwin.__all__}
    return (base for base in cls.__mro__[1:] if base in _NOT_SHOWN or base in public)


def _members_table(cls: type) -> str:
    attributes = {
        name: words
        for base in reversed(cls.__mro__)
        for name, words in _Docstring.of(base).sections.get("Attributes", {}).items()
    }
    members = public_members(cls)
    rows = [
        [f"`{members[name]}`", _sentence(attributes.get(name) or _Docstring.of(getattr(cls, name)).first)]
        for name in dict.fromkeys((*attributes, *members))
        if name in members
    ]
    return table(["member", ""], rows, text_columns=2) if rows else ""


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _section(name: str, *, constructed: bool) -> str:
    """Return the section of a name; classes that programs construct have their arguments in its heading."""
    thing = getattr(steptwin, name)
    text = _Docstring.of(thing)
    callable_ = not inspect.isclass(thing) or constructed
    parts = [f"### `{name}{signature(thing) if callable_ else ''}`", text.text]
    if arguments := text.sections.get("Args"):
        parts.append(table(["argument", ""], [[f"`{key}`", words] for key, words in arguments.items()], text_columns=2))
    if inspect.isclass(thing):
        parts.append(_members_table(thing))
    parts.extend(f"Raises `{error}`: {words}" for error, words in text.sections.get("Raises", {}).items())
    return "\n\n".join(part for part in parts if part)


def _row(name: str) -> list[str]:
    thing = getattr(steptwin, name)
    text = _Docstring.of(thing)
    members = getattr(thing, "__members__", {})
    spelled = name if members or issubclass(thing, BaseException) else f"{name}{signature(thing)}"
    told = [text.first, *(f"`{key}`: {words}" for key, words in text.sections.get("Attributes", {}).items())]
    return [
        f"`{spelled}`",
        " ".join([*told, *([f"Members: {', '.join(f'`{m}`' for m in members)}."] if members else [])]),
    ]


API_PAGE: Final = GeneratedPage(
    "api",
    "the docstrings",
    {
        "names": lambda names: "\n\n".join(_section(name, constructed=False) for name in names.split()),
        "constructed": lambda names: "\n\n".join(_section(name, constructed=True) for name in names.split()),
        "rows": lambda names: table(["name", ""], [_row(name) for name in names.split()], text_columns=2),
    },
)
