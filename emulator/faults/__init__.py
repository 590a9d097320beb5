"""What may go wrong with an emulated machine, its bus and its host: one dataclass a harm, one module a family."""

from steptwin.emulator.faults.bus import BUS
from steptwin.emulator.faults.drivers import DRIVERS
from steptwin.emulator.faults.harm import Harm
from steptwin.emulator.faults.host import HOST
from steptwin.emulator.faults.limit_switches import SWITCHES
from steptwin.emulator.faults.machine import MACHINE
from steptwin.emulator.faults.wiring import WIRES

HARMS: tuple[type[Harm], ...] = (*MACHINE, *SWITCHES, *DRIVERS, *WIRES, *BUS, *HOST)
"""Every harm for which a request asks, in the order of help and docs."""
