"""Let a node show other objects to the bus than those of `od`: the extension point for the objects of other drives.

The firmware keeps its own dictionary, in wire units. A view lists the entries that the bus sees instead, and makes the
cells behind them: most of them convert a value for a cell of the firmware. The firmware never sees a view's entries.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from steptwin.protocol.entry import DictionaryObject, Entry


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveTraits:
    """Behaviour of drives that CiA 402 leaves open and that no object selects.

    Attributes:
        zero_limits_off: software limits (607Dh), or ends of the position range (607Bh), that are both 0 are off.
        targets_at_arrival: cyclic modes take each target when it is written, with SYNC or without, and hold the last.
    """

    zero_limits_off: bool = False
    targets_at_arrival: bool = False


OWN_TRAITS = DriveTraits()


class FirmwareCell(Protocol):
    """A numeric entry of the firmware's own dictionary, as a view uses it; values are in wire units."""

    value: int
    low: int
    high: int

    def present(self) -> int:
        """Return the present value."""
        ...

    def command(self, value: int) -> None:
        """Let the firmware act on a value without a check of its range, then store it; SdoAbortError if it refuses."""
        ...


class ViewedCell(Protocol):
    """A numeric entry that the bus sees."""

    value: int

    @property
    def plain(self) -> bool:
        """True if a write needs no check and triggers nothing."""
        ...

    def get(self) -> int:
        """Return the present value."""
        ...

    def put(self, value: int) -> None:
        """Check and store a value; raise SdoAbortError if it is refused."""
        ...

    def reset(self, node_id: int, stored: Mapping[int, int]) -> None:
        """Return to the value after power-up; `stored` has those of the firmware's entries that flash holds."""
        ...


class ObjectView(Protocol):
    """The objects of a device, as the bus sees them."""

    @property
    def objects(self) -> tuple[DictionaryObject, ...]:
        """The objects in the order of their indexes."""
        ...

    @property
    def entries(self) -> Mapping[int, Entry]:
        """The entries of the objects by address."""
        ...

    @property
    def traits(self) -> DriveTraits:
        """The drive's behaviour."""
        ...

    def cells(self, firmware: Mapping[int, FirmwareCell]) -> Mapping[int, ViewedCell]:
        """Return new cells of one node, for all numeric entries, in the order in which a reset must reach them."""
        ...
