"""What may go wrong with an emulated machine, its bus and its host: one dataclass a harm, one module a family.

Harms are operations of the simulation.
"""

from steptwin.features.faults.kinds.bus import BUS
from steptwin.features.faults.kinds.drivers import DRIVERS
from steptwin.features.faults.kinds.harm import Harm
from steptwin.features.faults.kinds.host import HOST
from steptwin.features.faults.kinds.limit_switches import SWITCHES
from steptwin.features.faults.kinds.machine import MACHINE
from steptwin.features.faults.kinds.wiring import WIRES

HARMS: tuple[type[Harm], ...] = (*MACHINE, *SWITCHES, *DRIVERS, *WIRES, *BUS, *HOST)
"""Every harm for which a request asks, in the order of help and docs."""
