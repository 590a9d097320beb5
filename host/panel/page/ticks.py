"""The numbers that change many times a second, as one message for all browsers."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.panel.desk import Snapshot
from steptwin.host.panel.page.scene import flat_lines
from steptwin.host.robots.kinematics.base import POSE_KEYS


def tick_of(snapshot: Snapshot) -> dict[str, Any]:
    """Return what the panel's script shows of a snapshot: numbers in mm, degrees, percent and ms; None is unknown."""
    pose, activity = snapshot.pose, snapshot.activity
    return {
        "t": round(snapshot.time_s, 3),
        "q": [round(joint.position, 4) for joint in snapshot.joints],
        "known": [joint.homed for joint in snapshot.joints],
        "v": [_rounded(joint.rate) for joint in snapshot.joints],
        "e": [_rounded(joint.following_error) for joint in snapshot.joints],
        "pose": None if pose is None else [round(pose[key], 3) for key in POSE_KEYS],
        "arm": _drawable(snapshot.links_mm),
        "tool": None if pose is None else [round(pose[key], 2) for key in POSE_KEYS[:3]],
        "load": _rounded(snapshot.bus_load_percent),
        "fill": None if snapshot.queue_fill is None else round(100 * snapshot.queue_fill),
        "late": _rounded(snapshot.late_ms),
        "part": 0 if activity is None or activity.fraction is None else round(activity.fraction, 3),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)


def _drawable(parts: Iterable[FloatArray]) -> list[list[float]] | None:
    """Return the arm's parts; None where the mechanism cannot be assembled, which has no picture."""
    drawn = tuple(parts)
    return flat_lines(drawn) if drawn and all(np.isfinite(part).all() for part in drawn) else None
