"""The CANopen master: the same client drives the embedded board, a served one and a real one."""

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.homing import HomingSettings
from steptwin.host.client.link import Link
from steptwin.host.client.machine import AxisSettings, Machine, Progress, object_dictionary
from steptwin.host.client.outputs import OutputCommand
from steptwin.host.client.run import Run

__all__ = [
    "AxisClient",
    "AxisSettings",
    "HomingSettings",
    "Link",
    "Machine",
    "OutputCommand",
    "Progress",
    "Run",
    "object_dictionary",
]
