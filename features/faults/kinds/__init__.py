"""Faults of an emulated machine, its bus and its host: one class a fault, one module a family."""

from collections.abc import Mapping
from types import ModuleType
from typing import Final

from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds import bus, host, machine, wiring
from steptwin.features.faults.reaction import Documented

FAMILIES: Final[tuple[ModuleType, ...]] = (machine, wiring, bus, host)
FAULTS: Final[Mapping[str, type[Fault]]] = {
    each.do: each
    for family in FAMILIES
    for each in vars(family).values()
    if isinstance(each, type) and issubclass(each, Fault) and each.__module__ == family.__name__ and hasattr(each, "do")
}
"""Faults by name in requests, in the order of help and docs: each class of the families with such a name.
"""
DOCUMENTED: Final[tuple[Documented, ...]] = tuple(
    dict.fromkeys(row for fault in FAULTS.values() for row in fault.reactions)
)
"""Rows of the table of documented reactions."""
