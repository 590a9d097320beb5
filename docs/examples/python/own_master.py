"""Move an axis of a served board by a CANopen master of one's own, here the canopen library: `python own_master.py`."""

import time
from io import StringIO

import canopen

import steptwin

NODE = 0x11
"""The second axis of the teaching robot, th2."""
FULL_STEPS = 100
UNITS_PER_FULL_STEP = 16384
TARGET_REACHED = 1 << 10
PROFILE_POSITION = 1
ALLOWED_S = 20.0


def moved(node: canopen.RemoteNode, units: int) -> int:
    """Enable the drive, move to a position in profile position mode; return the position that the drive tells.

    Raises:
        TimeoutError: the target was not reached in time.
    """
    node.sdo["Modes of operation"].raw = PROFILE_POSITION
    for controlword in (0x06, 0x07, 0x0F):
        node.sdo[0x6040].raw = controlword
    node.sdo[0x607A].raw = units
    node.sdo[0x6040].raw = 0x1F  # bit 4: take the target
    end_s = time.monotonic() + ALLOWED_S
    while not (node.sdo[0x6041].raw & TARGET_REACHED and node.sdo[0x6064].raw == units):
        if time.monotonic() > end_s:
            raise TimeoutError(f"node 0x{node.id:02X} is at {node.sdo[0x6064].raw} units, not at {units}")
        time.sleep(0.02)
    return int(node.sdo[0x6064].raw)


def main() -> None:
    """Serve the board at a free port, connect, move, print where the drive is."""
    with steptwin.ServedBoard(steptwin.load_robot("teaching-scara"), port=0) as served:
        network = canopen.Network()
        network.connect(interface="socketcand", host="127.0.0.1", port=served.port, channel="vcan0")
        try:
            sheet = StringIO(steptwin.render_eds())
            sheet.name = "axis.eds"  # by which the library knows the format
            node = network.add_node(NODE, sheet)
            network.nmt.state = "OPERATIONAL"
            position = moved(node, FULL_STEPS * UNITS_PER_FULL_STEP)
        finally:
            network.disconnect()
    print(f"node 0x{NODE:02X} is at {position} units, {position / UNITS_PER_FULL_STEP:g} full steps")


if __name__ == "__main__":
    main()
