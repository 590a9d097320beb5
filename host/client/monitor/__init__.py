"""CAN frames in CANopen's words: what `steptwin monitor` shows."""

from steptwin.host.client.monitor.decoder import SERVICES, Decoded, Decoder

__all__ = ["SERVICES", "Decoded", "Decoder"]
