"""Decode CAN frames into CANopen's terms, for `steptwin monitor`."""

from steptwin.host.client.monitor.decoder import SERVICES, Decoded, Decoder

__all__ = ["SERVICES", "Decoded", "Decoder"]
