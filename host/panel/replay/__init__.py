"""Replay stored runs: what is shown of them at an instant, without the page that shows it."""

from steptwin.host.panel.replay.difference import Apart, Course, RunPair
from steptwin.host.panel.replay.lanes import Lane, Span
from steptwin.host.panel.replay.marks import MarkKind, RunMark
from steptwin.host.panel.replay.model import Edge, Instant, JointRow, Replay

__all__ = [
    "Apart",
    "Course",
    "Edge",
    "Instant",
    "JointRow",
    "Lane",
    "MarkKind",
    "Replay",
    "RunMark",
    "RunPair",
    "Span",
]  # fmt: skip
