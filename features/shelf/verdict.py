"""Judge a shelf: no faults, drawers open only as planned, every box in its place.

A shelf's report is evidence, not trusted: the boxes at the end must follow from those at the start by the events, and
at each event the drivers' counts must put the tool there.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from steptwin.features.shelf.errand import PlannedStock
from steptwin.features.shelf.evidence import ShelfEvent, ShelfEvidence
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, number_at
from steptwin.host.record.folder.npz_file import INSTANT_MAX
from steptwin.host.verify.comparison import Comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND

TAKEN: Final = "box taken"
PUT: Final = "box put down"
"""Name of the event in which a box is put down."""

TIP_TOLERANCE_MM: Final = 1.0
"""Largest motion of the tip between the instant of an event and the end of the servo tick."""


def reasons(shelf: ShelfEvidence, planned: PlannedStock | None, start_counts: int) -> list[str]:
    """Return one line for each fault, each drawer open or shut against the plan, and each misplaced box.

    `start_counts` is the motion's t = 0.
    """
    lines = [
        f"shelf: at {(event.counts - start_counts) / COUNTS_PER_SECOND:.3f} s: {event}"
        for event in shelf.events
        if event.fault
    ]
    stays_open = planned.leaves_open if planned else ()
    lines += [
        f"shelf: {slot}: the drawer is left {out_mm:.1f} mm out"
        for slot, out_mm in shelf.open_mm.items()
        if slot not in stays_open
    ]
    lines += [
        f"shelf: {slot}: the drawer is shut at the end (planned open)"
        for slot in stays_open
        if slot not in shelf.open_mm
    ]
    for place in planned.places if planned else ():
        is_there, wanted = (each.get(place, "") for each in (shelf.end, planned.boxes if planned else {}))
        if is_there != wanted:
            lines.append(f"shelf: {place}: holds {is_there or 'no box'} at the end (planned {wanted or 'no box'})")
    for place, wanted_boxes in planned.cleared.items() if planned else ():
        put_boxes = sum(event.what == PUT and event.where == place for event in shelf.events)
        if put_boxes != wanted_boxes:
            lines.append(f"shelf: {place}: boxes put down: {put_boxes} (planned {wanted_boxes})")
    return lines


def document(shelf: ShelfEvidence, start_counts: int) -> dict[str, Any]:
    """Return the shelf's part of report.json; times are the trajectory's."""
    events = [
        {
            "t_s": round((event.counts - start_counts) / COUNTS_PER_SECOND, 6),
            "what": event.what,
            "where": event.where,
            "box": event.box,
            "fault": event.fault,
        }
        for event in shelf.events
    ]
    return {"events": events, "start": dict(shelf.start), "end": dict(shelf.end), "open_mm": dict(shelf.open_mm)}


def contradictions(shelf: ShelfEvidence, comparison: Comparison) -> Iterator[str]:
    """Yield one line for each statement of the shelf that contradicts the drivers' counts or its own events."""
    stock, carried = dict(shelf.start), ""
    for event in shelf.events:
        if event.what == TAKEN:
            carried = event.box
            if stock.pop(event.where, event.box) != event.box:
                yield f"shelf: {event}, but another box was there"
        elif event.what == PUT:
            if event.box != carried:
                yield f"shelf: {event}, but the magnet held {carried or 'no box'}"
            stock[event.where], carried = event.box, ""
    for place, box in shelf.end.items():
        if stock.get(place, box) != box:
            yield f"shelf: {place}: holds {box} at the end, but {stock[place]} was there last"
    for event, tip_mm in zip(shelf.events, _counted_tips_mm(shelf, comparison), strict=True):
        away_mm = float(np.linalg.norm(tip_mm - np.array(event.tip_mm)))
        if not away_mm <= TIP_TOLERANCE_MM:
            yield f"shelf: {event}, but by the drivers' counts the tool was {away_mm:.1f} mm away from there"


def _counted_tips_mm(shelf: ShelfEvidence, comparison: Comparison) -> FloatArray:
    """Return the tool's tip at each event by the drivers' counts, shape (events, 3)."""
    if not shelf.events:
        return np.empty((0, 3))
    counts = np.array([event.counts for event in shelf.events])
    order = np.argsort(counts, kind="stable")
    t_s = (counts - comparison.evidence.start_counts)[order] / COUNTS_PER_SECOND
    steps = np.array([axis.around(t_s)[1] for axis in comparison.counted]).T
    tips_mm = np.empty((len(counts), 3))
    expected = comparison.expected
    tips_mm[order] = (expected.actual_forward or expected.forward)(expected.joints(steps))[:, :3]
    return tips_mm


def stored(shelf: ShelfEvidence, planned: PlannedStock | None, _start_counts: int) -> dict[str, Any]:
    """Return the content of shelf.json."""
    held: dict[str, Any] = {
        "events": [asdict(event) for event in shelf.events],
        "start": dict(shelf.start),
        "end": dict(shelf.end),
        "open_mm": dict(shelf.open_mm),
        "cells_out": dict(shelf.cells_out),
    }
    if planned is not None:
        held["planned"] = {place: planned.boxes.get(place, "") for place in planned.places}
        held["leaves_open"] = list(planned.leaves_open)
        held["cleared"] = dict(planned.cleared)
    return held


def read(table: Table) -> tuple[ShelfEvidence, PlannedStock | None]:
    """Return evidence and plan from shelf.json; raise InputError for a missing key or a value of another kind."""
    shelf = ShelfEvidence(
        events=table.each("events", _event),
        start=_texts(table, "start"),
        end=_texts(table, "end"),
        open_mm=_numbers(table, "open_mm"),
        cells_out=_whole_numbers(table, "cells_out"),
    )
    if "planned" not in table:
        return shelf, None
    planned, leaves_open = _texts(table, "planned"), _names(table, "leaves_open")
    cleared = _whole_numbers(table, "cleared")
    boxes = {place: box for place, box in planned.items() if box}
    return shelf, PlannedStock(tuple(planned), boxes, leaves_open, cleared)


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


def _names(table: Table, key: str) -> tuple[str, ...]:
    """Return a list of names; empty if it is missing, as in folders of earlier versions."""
    names = table.elements(key) if key in table else []
    if strange := [f"{key}[{i}]: is not a text" for i, name in enumerate(names) if not isinstance(name, str)]:
        raise InputError(*strange)
    return tuple(map(str, names))


def _texts(table: Table, key: str) -> Mapping[str, str]:
    with table.section(key) as section:
        return {name: section.text(name) for name in section}


def _whole_numbers(table: Table, key: str) -> Mapping[str, int]:
    """Return numbers by name; empty if the table is missing, as in folders of earlier versions."""
    if key not in table:
        return {}
    with table.section(key) as section:
        return {name: section.integer(name, INSTANT_MAX) for name in section}


def _numbers(table: Table, key: str) -> Mapping[str, float]:
    with table.section(key) as section:
        return {name: section.number(name) for name in section}
