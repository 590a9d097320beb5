"""Tell what a capture holds: its channels, how fast they change, their shortest pulses, and which look like a pair.

STEP has many short pulses of one width; DIR changes rarely, and while STEP rests.
"""

from typing import Any, Final

import numpy as np

from steptwin.host.record.captures.capture import Capture, Channel
from steptwin.host.record.captures.channel_map import pulse_widths_ticks

_PULSES_OF_STEP: Final = 20


def capture_facts(capture: Capture) -> dict[str, Any]:
    """Return what `steptwin capture` tells."""
    pairs = _pairs(capture)
    return {
        "kind": capture.kind,
        "duration_s": capture.duration_s,
        "rate_hz": capture.rate_hz,
        "channels": [_facts(capture, channel) for channel in capture.channels],
        "pairs": [{"step": step, "dir": direction} for step, direction in pairs],
    }


def _facts(capture: Capture, channel: Channel) -> dict[str, Any]:
    widths = pulse_widths_ticks(channel)
    gaps = np.diff(channel.edges[(channel.level & 1) :: 2])
    return {
        "name": channel.name,
        "first_level": channel.level,
        "edges": int(channel.edges.size),
        "shortest_pulse_us": float(widths.min() * capture.tick_s * 1e6) if widths.size else None,
        "usual_pulse_us": float(np.median(widths) * capture.tick_s * 1e6) if widths.size else None,
        "fastest_hz": float(1.0 / (gaps.min() * capture.tick_s)) if gaps.size and gaps.min() > 0 else None,
    }


def _pairs(capture: Capture) -> list[tuple[str, str]]:
    """Return the pairs of channels that look like STEP and DIR, each channel once, neighbours first."""
    steps = [i for i, channel in enumerate(capture.channels) if channel.edges.size >= 2 * _PULSES_OF_STEP]
    found, taken = [], set[int]()
    busy = {i for i in steps if _is_step(capture.channels[i])}
    for step in sorted(busy):
        pulses = capture.channels[step].edges.size // 2
        near = [
            i
            for i, channel in enumerate(capture.channels)
            if i not in busy | taken and channel.edges.size < pulses / 2 and _turns(capture.channels[step], channel)
        ]
        if near:
            direction = min(near, key=lambda i: abs(i - step - 0.5))
            taken.add(direction)
            found.append((capture.channels[step].name, capture.channels[direction].name))
    return found


def _is_step(channel: Channel) -> bool:
    """Return whether a channel's pulses are short beside their distances, or all of one width."""
    widths = pulse_widths_ticks(channel)
    middle = np.median(widths)
    return bool(np.mean(np.abs(widths - middle) <= 0.25 * middle + 2) > 0.9)


def _turns(step: Channel, direction: Channel) -> bool:
    """Return whether a channel changes between two pulses of STEP, and STEP is at rest then, as a driver asks for."""
    passed = np.searchsorted(step.edges, direction.edges)
    within = (passed > 0) & (passed < step.edges.size)
    levels = (step.level + passed[within]) & 1
    return bool(levels.size and np.bincount(levels, minlength=2).max() == levels.size)
