"""Read what other programs, or a run of ours, have recorded on a bus, and tell whose each frame is."""

from steptwin.host.record.recorded_bus.recorded_log import (
    FORMATS,
    RecordedBus,
    RecordedFrame,
    Sender,
    read_bus,
    senders_of,
)

__all__ = ["FORMATS", "RecordedBus", "RecordedFrame", "Sender", "read_bus", "senders_of"]
