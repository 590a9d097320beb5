"""A second kind of driver chip, as little as one can be: it counts every edge, and ten steps make a full step."""

from steptwin.protocol.drivers import ChipSheet, Fact, PinTable, StepTimes
from steptwin.protocol.drivers.chip_sheet import always

SUBSTEPS = 10
MADE = "made for a test"

EDGE_COUNTER = ChipSheet(
    name="edge counter",
    document=MADE,
    times=StepTimes(),
    modes=Fact(PinTable((), ((SUBSTEPS, ""),)), MADE),
    torque_percent=Fact(always(100), MADE),
    fast_decay_percent=Fact(always(0), MADE),
    home_deg=Fact(0.0, MADE),
    home_full_deg=Fact(0.0, MADE),
    blocked=Fact(False, MADE),
    current_law=Fact("none", MADE),
    current_max_a=Fact(1.5, MADE),
    sense_ohm=Fact(0.0, MADE),
    on_resistance_ohm=Fact(0.1, MADE),
    supply_v=Fact((4.5, 34.0), MADE),
)
