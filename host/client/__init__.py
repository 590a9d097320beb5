"""The CANopen master: the same client drives the embedded board, a served one and a real one."""

from host.client.axis import AxisClient
from host.client.homing import HomingSettings
from host.client.link import Link
from host.client.machine import AxisSettings, Machine, Progress, object_dictionary
from host.client.outputs import OutputCommand
from host.client.run import Run
from host.client.stream import AxisRecords

__all__ = [
    "AxisClient",
    "AxisRecords",
    "AxisSettings",
    "HomingSettings",
    "Link",
    "Machine",
    "OutputCommand",
    "Progress",
    "Run",
    "object_dictionary",
]
