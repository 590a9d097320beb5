"""Write and read shelf.json: what happened at the shelf, and where the boxes were planned to be in the end."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import REPORT_BYTES_MAX
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import Table, json_table, number_at
from steptwin.host.common.whole_file import whole_file
from steptwin.host.planning.errand import PlannedStock
from steptwin.host.record.folder.layout import SHELF, existing_file
from steptwin.host.record.folder.npz_file import INSTANT_MAX
from steptwin.host.verify import ShelfEvent, ShelfEvidence


def write_shelf(folder: Path, shelf: ShelfEvidence, planned: PlannedStock | None) -> None:
    """Write the file."""
    document: dict[str, Any] = {
        "events": [asdict(event) for event in shelf.events],
        "start": dict(shelf.start),
        "end": dict(shelf.end),
        "open_mm": dict(shelf.open_mm),
    }
    if planned is not None:
        document["planned"] = {place: planned.boxes.get(place, "") for place in planned.places}
    with whole_file(folder / SHELF) as file:
        file.write((json.dumps(document, indent=2) + "\n").encode())


def read_shelf(folder: Path) -> tuple[ShelfEvidence, PlannedStock | None]:
    """Read the file of a folder.

    Raises:
        InputError: the file is missing or not JSON, or a key is missing or has another kind.
    """
    path = existing_file(folder, SHELF)
    with prefixed(f"{path}: "):
        table = json_table(read_text(str(path), REPORT_BYTES_MAX))
        shelf = ShelfEvidence(
            events=table.each("events", _event),
            start=_texts(table, "start"),
            end=_texts(table, "end"),
            open_mm=_numbers(table, "open_mm"),
        )
        if "planned" not in table:
            return shelf, None
        planned = _texts(table, "planned")
    return shelf, PlannedStock(tuple(planned), {place: box for place, box in planned.items() if box})


def _event(table: Table) -> ShelfEvent:
    tip_mm = [number_at(f"tip_mm[{i}]", value) for i, value in enumerate(table.elements("tip_mm"))]
    if len(tip_mm) != len("xyz"):
        raise InputError(f"tip_mm: has {len(tip_mm)} values, not three")
    counts = table.integer("counts", INSTANT_MAX)
    if counts < 0:
        raise InputError(f"counts: {counts} is before power-up")
    x_mm, y_mm, z_mm = tip_mm
    return ShelfEvent(
        counts=counts,
        what=table.text("what"),
        where=table.text("where"),
        box=table.text("box"),
        fault=table.truth("fault"),
        tip_mm=(x_mm, y_mm, z_mm),
    )


def _texts(table: Table, key: str) -> Mapping[str, str]:
    with table.section(key) as section:
        return {name: section.text(name) for name in section}


def _numbers(table: Table, key: str) -> Mapping[str, float]:
    with table.section(key) as section:
        return {name: section.number(name) for name in section}
