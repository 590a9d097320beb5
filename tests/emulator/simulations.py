"""What tests of simulated boards share: time, SDO writes, and units of motion."""

from steptwin.emulator.simulation import Simulation
from steptwin.protocol.frame import COB_SDO_REQUEST, Frame
from steptwin.protocol.od import index_and_subindex
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

MS = COUNTS_PER_MS
SECOND = COUNTS_PER_SECOND
STEP = 1024
"""Wire units in a step, at 16 microsteps."""


def wait(simulation: Simulation, dt_ms: float) -> None:
    """Let simulated time pass."""
    simulation.run_until(simulation.now_counts + round(dt_ms * MS))


def write(simulation: Simulation, node_id: int, address: int, value: int) -> None:
    """Write a 32-bit entry of a node by SDO."""
    index, subindex = index_and_subindex(address)
    head = b"\x23" + index.to_bytes(2, "little") + bytes((subindex,))
    simulation.send(Frame(COB_SDO_REQUEST + node_id, head + value.to_bytes(4, "little")))
