"""Replay a recorded bus: let its hosts speak to emulated boards in virtual time, and compare what the boards do.

`standing` is how the machine stood at power-up, `machine` the boards, `playing` sends the hosts' frames at their
instants, `frames` and `edges` compare, `replaying` does it all.
"""

from steptwin.host.twin.replay.replaying import Replayed, replay
from steptwin.host.twin.replay.standing import PowerUp, power_up_of

__all__ = ["PowerUp", "Replayed", "power_up_of", "replay"]
