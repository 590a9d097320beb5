"""How an emulated shelf differs from the usual one."""

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
    """The boxes and locked drawers of an emulated shelf, and what a motion is planned to do with the boxes.

    Attributes:
        stock: the box in each slot and at each spot that has one; None: those of the errand, without one a box at each
            spot where boxes are taken.
        locked_drawers: slots whose drawers are locked.
        errand: what the motion is planned to do with the boxes; each must be where it is planned in the end.
    """

    stock: Mapping[str, str] | None = field(default=None, metadata={SPELLING: _STOCK})
    locked_drawers: Collection[str] = field(default=(), metadata={SPELLING: _LOCKED})
    errand: "Errand | None" = None

    @property
    def boxes(self) -> Mapping[str, str] | None:
        """The box in each place; None: the usual ones."""
        return self.errand.stock if self.stock is None and self.errand is not None else self.stock

    def over(self, other: "ShelfOptions") -> "ShelfOptions":
        """Return other options, with those of these that are no defaults in place of theirs."""
        return ShelfOptions(
            stock=other.stock if self.stock is None else self.stock,
            locked_drawers=self.locked_drawers or other.locked_drawers,
            errand=self.errand or other.errand,
        )
