"""Read VCD files word by word (IEEE 1364-2005, clause 18); the reader shares nothing with the writer."""

from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass
class Dump:
    """Content of a file: for each variable by name its type, scope, initial value, and changes with their instants."""

    timescale: str = ""
    types: dict[str, str] = field(default_factory=dict)
    scopes: dict[str, str] = field(default_factory=dict)
    initial: dict[str, str] = field(default_factory=dict)
    changes: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    instants: list[int] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    """Texts of the comments and of the version."""


def read_vcd(text: str) -> Dump:
    """Read a file; raise AssertionError if it breaks a rule that every reader relies on."""
    words = iter(text.split())
    dump = Dump()
    names: dict[str, str] = {}
    _header(words, dump, names)
    dumping = False
    for word in words:
        if word == "$dumpvars":
            assert dump.instants
            dumping = True
        elif word == "$end":
            dumping = False
        elif word[0] == "#":
            instant = int(word[1:])
            assert not dump.instants or instant > dump.instants[-1], "time goes on"
            dump.instants.append(instant)
        elif word[0] in "01":
            _take(dump, names[word[1:]], word[0], dumping)
        else:
            assert word[0] in "rs", word
            _take(dump, names[next(words)], word[1:], dumping)
    assert set(dump.initial) == set(dump.types), "each variable has an initial value"
    return dump


def _header(words: Iterator[str], dump: Dump, names: dict[str, str]) -> None:
    scopes: list[str] = []
    for word in words:
        body = []
        while (part := next(words)) != "$end":
            body.append(part)
        if word == "$enddefinitions":
            return
        if word == "$timescale":
            dump.timescale = " ".join(body)
        elif word == "$scope":
            scopes.append(body[1])
        elif word == "$upscope":
            scopes.pop()
        elif word == "$var":
            kind, bits, code, name = body
            assert code not in names
            assert name not in dump.types, "names are different without their scopes"
            names[code] = name
            dump.types[name] = f"{kind} {bits}"
            dump.scopes[name] = ".".join(scopes)
            dump.changes[name] = []
        else:
            assert word in {"$version", "$comment"}, word
            dump.texts.append(" ".join(body))


def _take(dump: Dump, name: str, value: str, dumping: bool) -> None:
    if dumping:
        dump.initial[name] = value
    else:
        dump.changes[name].append((dump.instants[-1], value))
