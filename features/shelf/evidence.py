"""What happened at a shelf, as evidence."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class ShelfEvent:
    """Something that happened at the shelf.

    Attributes:
        counts: its instant.
        what: what happened, in words.
        where: the slot or the spot; empty if it happened at none.
        box: the box that it concerns; empty without one.
        fault: True for what must not happen at a shelf.
        tip_mm: where the tool's tip was, x, y and z.
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
    """Everything that happened at the shelf.

    Attributes:
        events: in order of time.
        start: the box in each slot and at each spot that had one at power-up.
        end: the same at the end.
        open_mm: how far each drawer is out at the end that is not shut.
        cells_out: number of its cells, from the front, that are wholly out.
    """

    events: tuple[ShelfEvent, ...] = ()
    start: Mapping[str, str] = field(default_factory=dict)
    end: Mapping[str, str] = field(default_factory=dict)
    open_mm: Mapping[str, float] = field(default_factory=dict)
    cells_out: Mapping[str, int] = field(default_factory=dict)
