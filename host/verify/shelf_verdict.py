"""Judge what happened at a shelf: no fault, only those drawers open that the plan leaves so, every box in its place.

What a shelf reports is evidence and is not taken on trust: the boxes at the end must follow from those at the start by
the events, and at each event the tool must have been where the drivers' counts put it.
"""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.errand import PlannedStock
from steptwin.host.verify.comparison import Comparison
from steptwin.host.verify.evidence import ShelfEvidence
from steptwin.protocol.timer import COUNTS_PER_SECOND

TAKEN: Final = "box taken"
PUT: Final = "box put down"
"""The events by which boxes move."""

TIP_TOLERANCE_MM: Final = 1.0
"""Distance by which the tip may have moved between the instant of an event and the end of the servo tick."""


def shelf_reasons(shelf: ShelfEvidence, planned: PlannedStock | None, start_counts: int) -> list[str]:
    """Return one line for each fault, each drawer that is open or shut against the plan, and each misplaced box.

    `start_counts` is the motion's t = 0.
    """
    reasons = [
        f"shelf: at {(event.counts - start_counts) / COUNTS_PER_SECOND:.3f} s: {event}"
        for event in shelf.events
        if event.fault
    ]
    stays_open = planned.leaves_open if planned else ()
    reasons += [
        f"shelf: {slot}: the drawer is left {out_mm:.1f} mm out"
        for slot, out_mm in shelf.open_mm.items()
        if slot not in stays_open
    ]
    reasons += [
        f"shelf: {slot}: the drawer is shut at the end (planned open)"
        for slot in stays_open
        if slot not in shelf.open_mm
    ]
    for place in planned.places if planned else ():
        is_there, wanted = (each.get(place, "") for each in (shelf.end, planned.boxes if planned else {}))
        if is_there != wanted:
            reasons.append(f"shelf: {place}: holds {is_there or 'no box'} at the end (planned {wanted or 'no box'})")
    for place, wanted_boxes in planned.cleared.items() if planned else ():
        put_boxes = sum(event.what == PUT and event.where == place for event in shelf.events)
        if put_boxes != wanted_boxes:
            reasons.append(f"shelf: {place}: boxes put down: {put_boxes} (planned {wanted_boxes})")
    return reasons


def shelf_document(shelf: ShelfEvidence, start_counts: int) -> dict[str, Any]:
    """Return the shelf under its key in the JSON document of a run; times are the trajectory's."""
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


def shelf_contradictions(shelf: ShelfEvidence, comparison: Comparison) -> Iterator[str]:
    """Yield one line for each statement of the shelf that the drivers' counts or its own events contradict."""
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
    """Return where the tool's tip was at each event by the drivers' counts, shape (events, 3)."""
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
