"""Captures of a logic analyser: read the files, wire channels to axes, find the plan's time in them."""

from steptwin.host.record.captures.capture import Capture, Channel
from steptwin.host.record.captures.channel_map import AxisSignals, ChannelMap, wired
from steptwin.host.record.captures.clock_fit import ClockFit, fit_clock
from steptwin.host.record.captures.facts import capture_facts
from steptwin.host.record.captures.reading import read_capture

__all__ = [
    "AxisSignals",
    "Capture",
    "Channel",
    "ChannelMap",
    "ClockFit",
    "capture_facts",
    "fit_clock",
    "read_capture",
    "wired",
]
