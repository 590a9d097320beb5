"""What tests of simulated boards share: time, SDO writes, and units of motion."""

from steptwin.controller.node.pins import Pin
from steptwin.emulator.simulation import Simulation
from steptwin.protocol.frame import COB_SDO_REQUEST, Frame
from steptwin.protocol.od import index_and_subindex
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

MS = COUNTS_PER_MS
SECOND = COUNTS_PER_SECOND
STEP = 1024
"""Wire units in a step, at 16 microsteps."""
NODE = 0x10
"""The node of the first axis."""


def wait(simulation: Simulation, dt_ms: float) -> None:
    """Let simulated time pass."""
    simulation.run_until(simulation.now_counts + round(dt_ms * MS))


def write(simulation: Simulation, node_id: int, address: int, value: int) -> None:
    """Write a 32-bit entry of a node by SDO."""
    index, subindex = index_and_subindex(address)
    head = b"\x23" + index.to_bytes(2, "little") + bytes((subindex,))
    simulation.send(Frame(COB_SDO_REQUEST + node_id, head + value.to_bytes(4, "little")))


def switch_on(simulation: Simulation) -> int:
    """Bring axis 0 to OPERATION ENABLED for interpolation; return the instant at which ENABLE rose."""
    for cob_id, data in ((0x000, "0110"), (0x210, "060007"), (0x210, "070007"), (0x210, "0f0007")):
        simulation.send(Frame(cob_id, bytes.fromhex(data)))
    simulation.boards[0].drain()
    return [change.counts for change in simulation.boards[0].pin_changes if change.pin is Pin.ENABLE][-1]
