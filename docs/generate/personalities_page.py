"""Render docs/personalities.md: the objects of each personality, what stands behind them, and what is lacking."""

from itertools import groupby
from typing import Final

from docs.generate.commands import GeneratedPage
from docs.generate.markdown import table
from steptwin.features.personalities.command import behind_text, is_pdo_parameter
from steptwin.features.personalities.file import read_personality_file
from steptwin.features.personalities.personality import Personality, load_personality


def _value(default: int | str) -> str:
    return f"0x{default:X}" if isinstance(default, int) and default >= 1 << 16 else f"{default}"


def _rows(made: Personality) -> list[list[str]]:
    rows = []
    shown = [address for address in sorted(made.rows) if not is_pdo_parameter(address)]
    for index, addresses in groupby(shown, key=lambda address: address >> 8):
        entries = [(address, made.rows[address]) for address in addresses]
        name = next(item.name for item in made.objects if item.index == index)
        behind = ", ".join(dict.fromkeys(behind_text(address, row) for address, row in entries))
        defaults = [_value(row.entry.default) for _, row in entries]
        sources = ", ".join(dict.fromkeys(each for _, row in entries for each in row.source.split(",")))
        rows.append([f"0x{index:04X}", name, behind, ", ".join(defaults), sources])
    return rows


def _drive(name: str) -> str:
    made, file = load_personality(name), read_personality_file(name)
    parts = [
        f"## {made.device}: `{name}`",
        table(["object", "name", "behind", "default", "source"], _rows(made), text_columns=5),
        "Not there, or not as in the drive:",
        table(["what", "why"], [[what, why] for what, why in made.lacking.items()], text_columns=2),
        "Sources:",
        "\n".join(f"- {key}: {text}" for key, text in file.sources.items()),
    ]
    return "\n\n".join(parts)


PERSONALITIES_PAGE: Final = GeneratedPage("personalities", "features/personalities/drives", {"drive": _drive})
