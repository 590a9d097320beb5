"""The CANopen master: it drives embedded, served and real boards in the same way and knows no robot."""

from steptwin.host.client.axis import AxisClient, AxisSettings
from steptwin.host.client.axis_homing import HomingSettings
from steptwin.host.client.links import Link
from steptwin.host.client.machine import Machine, Progress, object_dictionary
from steptwin.host.client.stream import Stream, StreamedMotion
from steptwin.host.client.waits import MachineWiring

__all__ = [
    "AxisClient",
    "AxisSettings",
    "HomingSettings",
    "Link",
    "Machine",
    "MachineWiring",
    "Progress",
    "Stream",
    "StreamedMotion",
    "object_dictionary",
]
