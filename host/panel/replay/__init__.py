"""Replay stored runs: what is shown of them at an instant, without the page that shows it."""

from steptwin.host.panel.replay.difference import Apart, Course, Difference
from steptwin.host.panel.replay.lanes import Lane, Span
from steptwin.host.panel.replay.marks import Mark, MarkKind
from steptwin.host.panel.replay.model import Edge, Instant, JointRow, Replay

__all__ = [
    "Apart", "Course", "Difference", "Edge", "Instant", "JointRow", "Lane", "Mark", "MarkKind", "Replay", "Span",
]  # fmt: skip
