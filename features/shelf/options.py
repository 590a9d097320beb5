"""Options of an emulated shelf."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from steptwin.host.common.choices import name_value_pairs
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

if TYPE_CHECKING:
    from steptwin.features.shelf.errand import Errand

_STOCK: Final = Spelling(
    key="stock",
    value="PLACE=BOX",
    example='{"A1": "screws"}',
    says="Box in a slot of the emulated shelf or at a spot, in place of the usual ones; repeatable.",
    read=name_value_pairs,
    repeatable=True,
)
_LOCKED: Final = Spelling(
    key="locked-drawer",
    value="SLOT",
    example='["A1"]',
    says="Lock a drawer of the emulated shelf; repeatable.",
    repeatable=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShelfOptions:
    """Boxes and locked drawers of an emulated shelf, and the planned errand.

    Attributes:
        stock: box of each occupied slot and spot; None: the errand's boxes, or without errand a box at each feeding
            spot.
        locked_drawers: slots with locked drawers.
        errand: planned transports; each box must end in its planned place.
    """

    stock: Mapping[str, str] | None = field(default=None, metadata={SPELLING: _STOCK})
    locked_drawers: Collection[str] = field(default=(), metadata={SPELLING: _LOCKED})
    errand: "Errand | None" = None

    @property
    def boxes(self) -> Mapping[str, str] | None:
        """Box of each occupied place; None: the default ones."""
        return self.errand.stock if self.stock is None and self.errand is not None else self.stock

    def over(self, other: "ShelfOptions") -> "ShelfOptions":
        """Return `other`, with the values of this object that are not defaults in place of its own."""
        return ShelfOptions(
            stock=other.stock if self.stock is None else self.stock,
            locked_drawers=self.locked_drawers or other.locked_drawers,
            errand=self.errand or other.errand,
        )
