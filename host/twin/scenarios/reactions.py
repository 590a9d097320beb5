"""The documented reaction to each harm, as one table: the page docs/faults.md shows it, tests walk through it.

The first row whose condition holds is the documented one. A condition may depend on what the machine is doing when the
fault begins: a limit switch stops only an axis that moves towards it. Where it depends on what comes later as well, the
reaction is not certain: both it and none are right.
"""

from collections.abc import Sequence
from typing import Final

from steptwin.emulator.faults.operations import BrownOut, BusOff, PowerUp, WatchdogReset
from steptwin.host.twin.scenarios import bus_reactions, host_reactions, machine_reactions, wire_reactions
from steptwin.host.twin.scenarios.harms import Harm, on_axis
from steptwin.host.twin.scenarios.moment import Moment
from steptwin.host.twin.scenarios.reaction import Documented

DOCUMENTED: Final = (*machine_reactions.ROWS, *wire_reactions.ROWS, *bus_reactions.ROWS, *host_reactions.ROWS)
"""Every row; those of one kind of harm, among which the order matters, are in one module."""


def documented(harm: Harm, moment: Moment) -> Documented:
    """Return the row for a harm that begins while the machine does this."""
    return next(row for row in DOCUMENTED if row.applies(harm, moment))


def concerned(harm: Harm, boards: Sequence[int]) -> list[int]:
    """Return the axes, whose boards have these numbers, that answer a harm; those of their group stop with them.

    What is done to a board concerns all axes on it.
    """
    axes = range(len(boards))
    axis = on_axis(harm)
    if axis is not None:
        return [axis]
    if isinstance(harm, BrownOut | WatchdogReset | PowerUp | BusOff) and harm.axis is not None:
        return [each for each in axes if boards[each] == boards[harm.axis]]
    return list(axes)
