"""Replay a recorded bus: let its hosts speak to emulated boards in virtual time, and compare what the boards do.

`power_up` is how the machine stood at power-up, `machine` the boards, `playing` sends the hosts' frames at their
instants, `frames` and `edges` compare, `replaying` does it all.
"""

from steptwin.host.twin.replay.power_up import MachineAtPowerUp, StoredMachine, stored_machine
from steptwin.host.twin.replay.replaying import Replayed, replay

__all__ = ["MachineAtPowerUp", "Replayed", "StoredMachine", "replay", "stored_machine"]
