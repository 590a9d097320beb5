"""Read what other programs, or a run of ours, have recorded on a bus, and tell whose each frame is."""

from steptwin.host.record.recorded_bus.reading import FORMATS, RecordedBus, RecordedFrame, read_bus
from steptwin.host.record.recorded_bus.stations import Sender, senders_of

__all__ = ["FORMATS", "RecordedBus", "RecordedFrame", "Sender", "read_bus", "senders_of"]
