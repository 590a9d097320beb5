"""The CANopen master, which drives the embedded board, a served one and a real one alike; it knows no robot."""

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.axis_settings import AxisSettings
from steptwin.host.client.homing import HomingSettings
from steptwin.host.client.input_wait import InputWait
from steptwin.host.client.link import Link
from steptwin.host.client.machine import Machine, Progress
from steptwin.host.client.object_dictionary import object_dictionary
from steptwin.host.client.output_schedule import OutputCommand
from steptwin.host.client.stream import Stream

__all__ = [
    "AxisClient",
    "AxisSettings",
    "HomingSettings",
    "InputWait",
    "Link",
    "Machine",
    "OutputCommand",
    "Progress",
    "Stream",
    "object_dictionary",
]
