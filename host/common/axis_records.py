"""The PVT records of one axis, as the planner makes them and the client streams them."""

from typing import NamedTuple


class AxisRecords(NamedTuple):
    """The segments of one axis, as equally long lists: the fields of PVT records without their sequence numbers."""

    displacements_units: list[int]
    end_velocities: list[int]
    durations_ms: list[int]
