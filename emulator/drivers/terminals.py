"""The terminals of a driver: static levels and stretches of edges."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.emulator.board.edges import Int8Array, Int64Array


class Rail(StrEnum):
    """A supply: VDD of the chip's logic, VM of its bridges. Its level is high when it is up."""

    VDD = "VDD"
    VM = "VM"


class LevelChange(NamedTuple):
    """A level change at a named terminal: a supply, a pin of the board, or a switch of the driver."""

    counts: int
    terminal: str
    level: int


@dataclass(frozen=True, slots=True)
class TerminalEdges:
    """One stretch of edges at a driver's inputs: sorted times in counts, and the level after each edge.

    A pulse may begin in one stretch and end in a later one. If the terminals are the chip's pins, it has then already
    been high long enough to count.

    Attributes:
        clk_rise_counts: shape (pulses,), rises of STEP.
        clk_fall_counts: falls of STEP. The first may end a pulse of an earlier stretch; the last pulse may have none.
        dir_counts: shape (d,), edges of DIR.
        dir_levels: shape (d,), levels of DIR after its edges.
        changes: level changes of the static terminals.
        until_counts: all edges before this instant are in this stretch or an earlier one.
    """

    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array
    changes: tuple[LevelChange, ...]
    until_counts: int

    @property
    def ends_earlier(self) -> bool:
        """True if the first fall ends a pulse of an earlier stretch."""
        rises, falls = self.clk_rise_counts, self.clk_fall_counts
        return bool(falls.size and not (rises.size and rises[0] < falls[0]))


SubstepArray = NDArray[np.signedinteger[Any]]
Moves = tuple[Int64Array, SubstepArray]
"""Instants of a rotor's moves, and signed moves in substeps (`ChipSheet.substeps`)."""
