"""Evidence of a shelf: its events and contents."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class ShelfEvent:
    """An event at the shelf.

    Attributes:
        counts: instant of the event.
        what: the event as text.
        where: slot or spot; empty without one.
        box: box of the event; empty without one.
        fault: True for an event that must not happen.
        tip_mm: x, y and z of the tool's tip.
    """

    counts: int
    what: str
    where: str
    box: str
    fault: bool
    tip_mm: tuple[float, float, float]

    def __str__(self) -> str:
        x_mm, y_mm, z_mm = self.tip_mm
        box = f" ({self.box})" if self.box else ""
        place = f"{self.where}: " if self.where else ""
        return f"{place}{self.what}{box} at x {x_mm:.1f}, y {y_mm:.1f}, z {z_mm:.1f} mm"


@dataclass(frozen=True, slots=True)
class ShelfEvidence:
    """All events at the shelf, with its contents at start and end.

    Attributes:
        events: in order of time.
        start: box of each occupied slot and spot at power-up.
        end: box of each occupied slot and spot at the end.
        open_mm: opening at the end of each drawer that is not shut.
        cells_out: number of cells of each such drawer, from the front, that are wholly out.
    """

    events: tuple[ShelfEvent, ...] = ()
    start: Mapping[str, str] = field(default_factory=dict)
    end: Mapping[str, str] = field(default_factory=dict)
    open_mm: Mapping[str, float] = field(default_factory=dict)
    cells_out: Mapping[str, int] = field(default_factory=dict)
