"""Draw the machine of a session: axes, bus, switches, start positions."""

from random import Random

from steptwin.emulator.world.switches import Switch
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import BITRATES
from tests.emulator.random_host.session import Setup, machine_board

_READ_LATENCIES_COUNTS = (0, 720, 7_200)


def random_setup(draw: Random) -> Setup:
    """Return a machine with 1 to 8 axes, most of them few, some with switches."""
    axis_count = draw.choice((1, 1, 2, 2, 2, 3, 3, 4, 5, 6, 7, 8))
    starts = tuple(draw.randint(-400, 400) for _ in range(axis_count))
    switches = [switch for axis in range(axis_count) if draw.random() < 0.5 for switch in _switches(draw, axis)]
    board = machine_board(draw.choice(_READ_LATENCIES_COUNTS), tuple(switches), starts)
    return Setup(draw.choice(BITRATES), board, steady_ramps=draw.random() < 0.4)


def _switches(draw: Random, axis: int) -> tuple[Switch, ...]:
    """Return limit switches at both ends of an axis, and between them a home switch."""
    home = draw.randint(-80, 40)
    hysteresis = draw.choice((0, 0, 3))
    return (
        Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_substeps=draw.randint(-400, -200), hysteresis_substeps=hysteresis),
        Switch(axis, DigitalInput.POSITIVE_LIMIT, from_substeps=draw.randint(200, 400), hysteresis_substeps=hysteresis),
        Switch(axis, DigitalInput.HOME, home, home + draw.randint(20, 60), hysteresis),
    )
