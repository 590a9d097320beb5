"""The pictures and tables of a replay as markup: pins, currents, the strip above the slider, joints.

Pictures are stretched to the width of their card, so texts are outside of them. Colours are CSS variables of the page's
style sheet. Texts from files are escaped.
"""

from collections.abc import Sequence
from html import escape
from itertools import pairwise
from typing import Final

import numpy as np

from steptwin.features.view.marks import MarkKind, RunMark
from steptwin.features.view.model import Apart, Instant, Lane, Span
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.protocol.timer import COUNTS_PER_SECOND

WIDTH: Final = 1000
"""Width of the pictures in their own units; the page scales them."""

_LANE: Final = 22
_HIGH: Final = 14
"""Height of a lane, and of a high level in it."""

_CURRENT_HEIGHT: Final = 108
_STRIP_HEIGHT: Final = 48
_MARK_HEIGHT: Final = 10
_STRIP_COLUMNS: Final = 500

MARK_COLOURS: Final = {
    MarkKind.VIOLATION: "var(--bad)",
    MarkKind.ERROR: "var(--bad)",
    MarkKind.STATE: "var(--muted)",
    MarkKind.OUTPUT: "var(--good)",
}


def pins_picture(lanes: Sequence[Lane], span: Span, cursor_counts: int) -> str:
    """Return a lane for each pin beside its name, and a line at the cursor."""
    height = _LANE * len(lanes)
    names, parts = [], []
    for row, lane in enumerate(lanes):
        base = row * _LANE + (_LANE + _HIGH) / 2
        if row and lanes[row - 1].axis != lane.axis:
            parts.append(_line(f"M0 {row * _LANE}H{WIDTH}", "var(--line)"))
        names.append(_name(f"{lane.axis} {lane.quantity.upper()}", _LANE))
        parts.append(_crowded(lane, base) if lane.crowded else _levels(lane, span, base))
    picture = _svg(height, "pins around the cursor", [*parts, _cursor(span, cursor_counts, height)])
    return _beside("".join(names), picture)


def _levels(lane: Lane, span: Span, base: float) -> str:
    return _line(_course(_across(lane.counts, span), base - _HIGH * lane.values), "var(--accent)", 1.5)


def _crowded(lane: Lane, base: float) -> str:
    title = f"<title>{lane.changes} changes: a shorter window shows them</title>"
    return f'<rect x="0" y="{base - _HIGH:g}" width="{WIDTH}" height="{_HIGH}" fill="var(--soft)">{title}</rect>'


def currents_picture(both: tuple[Lane, Lane], span: Span, cursor_counts: int) -> str:
    """Return the currents of phases A and B of one axis over time, beside their names."""
    if any(lane.crowded for lane in both):
        return f'<p class="note">{max(lane.changes for lane in both)} changes: a shorter window shows them.</p>'
    peak_ma = max(100.0, *(float(np.abs(lane.values).max()) for lane in both))
    middle, scale = _CURRENT_HEIGHT / 2, (_CURRENT_HEIGHT / 2 - 4) / peak_ma
    parts, names = [_line(f"M0 {middle:g}H{WIDTH}", "var(--line)")], [_name(f"{peak_ma / 1e3:.3g} A", 28)]
    for lane, phase, colour in zip(both, "AB", ("var(--series-1)", "var(--series-2)"), strict=True):
        parts.append(_line(_course(_across(lane.counts, span), middle - scale * lane.values), colour, 1.8))
        names.append(_name(f"phase {phase}", 24, colour))
    names.append(_name(f"-{peak_ma / 1e3:.3g} A", 32, "var(--muted)", "end"))
    picture = _svg(
        _CURRENT_HEIGHT, "phase currents around the cursor", [*parts, _cursor(span, cursor_counts, _CURRENT_HEIGHT)]
    )
    return _beside("".join(names), picture)


def strip_picture(
    t_s: FloatArray, values: FloatArray, ends_s: tuple[float, float], marks: Sequence[tuple[float, RunMark]]
) -> str:
    """Return a picture of the slider's whole range: a curve of values from 0 on, and the marks.

    Args:
        t_s: shape (n,), sorted.
        values: shape (n,), at least 0.
        ends_s: first and last time of the slider.
        marks: each mark with its time.
    """
    first_s, last_s = ends_s
    scale = WIDTH / max(last_s - first_s, 1e-9)
    at = np.searchsorted(t_s, np.linspace(first_s, last_s, _STRIP_COLUMNS + 1))
    peaks = np.array([values[a : max(b, a + 1)].max(initial=0.0) for a, b in pairwise(at.tolist())])
    heights = _STRIP_HEIGHT - (_STRIP_HEIGHT - _MARK_HEIGHT - 4) * peaks / (float(peaks.max()) or 1.0)
    columns = "".join(f"L{i * WIDTH / (_STRIP_COLUMNS - 1):.1f} {height:.1f}" for i, height in enumerate(heights))
    curve = f"M0 {_STRIP_HEIGHT}{columns}L{WIDTH} {_STRIP_HEIGHT}Z"
    parts = [f'<path d="{curve}" fill="var(--accent)" opacity="0.35"/>']
    for mark_s, mark in marks:
        x = min(max((mark_s - first_s) * scale, 0.0), WIDTH)
        width = max(3.0, (mark.until_counts - mark.counts) / COUNTS_PER_SECOND * scale)
        place = f'x="{x - 1.5:.1f}" y="0" width="{width:.1f}" height="{_MARK_HEIGHT}"'
        title = f"<title>{escape(f'{mark_s:.6f} s: {mark.who}: {mark.text}')}</title>"
        parts.append(f'<rect {place} fill="{MARK_COLOURS[mark.kind]}">{title}</rect>')
    return _svg(_STRIP_HEIGHT, "the whole run, with its marks", parts)


def joint_table(shown: Sequence[Instant], apart: Apart | None) -> str:
    """Return the table of joints and tool at the cursor, of one run or of two with their difference."""
    if apart is None:
        heads, joints, pose = _of_one(shown[0])
    else:
        heads, joints, pose = ["first", "second", "difference"], *_of_two(shown, apart)
    rows = [_row("th", "joint", "", heads)]
    rows += [_row("td", joint.name, joint.unit, cells) for joint, cells in zip(shown[0].joints, joints, strict=True)]
    coordinates = shown[0].task.coordinates.items()
    rows += [_row("td", name, unit, cells) for (name, unit), cells in zip(coordinates, pose, strict=True)]
    distance_mm = shown[0].tool_error_mm if apart is None else apart.tool_mm
    what = "Tool from where it was planned" if apart is None else "Tools from each other"
    if apart is None and not shown[0].has_plan:
        return f'<table class="grid-table"><tbody>{"".join(rows)}</tbody></table>'
    turned = "" if apart is None or shown[0].task.is_flat else f", turned by {apart.attitude_deg:.4f} deg"
    distance = f'<p class="muted small">{what}: <b class="number">{distance_mm:.4f} mm{turned}</b></p>'
    return f'<table class="grid-table"><tbody>{"".join(rows)}</tbody></table>{distance}'


def _of_one(shown: Instant) -> tuple[list[str], list[list[str]], list[list[str]]]:
    if not shown.has_plan:
        counted = [[f"{row.counted:.4f}", f"{row.steps}"] for row in shown.joints]
        return ["counted", "count"], counted, [[f"{value:.4f}", ""] for value in shown.counted_pose]
    joints = [
        [f"{row.planned:.4f}", f"{row.counted:.4f}", f"{row.error_steps:+.3f}", f"{row.steps}"] for row in shown.joints
    ]
    poses = zip(shown.planned_pose, shown.counted_pose, strict=True)
    pose = [[f"{planned:.4f}", f"{counted:.4f}", "", ""] for planned, counted in poses]
    return ["planned", "counted", "error in steps", "count"], joints, pose


def _of_two(shown: Sequence[Instant], apart: Apart) -> tuple[list[list[str]], list[list[str]]]:
    first, second = shown
    joints = [
        [f"{one.counted:.4f}", f"{other.counted:.4f}", f"{apart.joints[one.name]:+.4f}"]
        for one, other in zip(first.joints, second.joints, strict=True)
    ]
    off = [f"{b - a:+.4f}" for a, b in zip(first.counted_pose, second.counted_pose, strict=True)][:3]
    off += [f"{apart.attitude_deg:+.4f}"] if first.task.is_flat else [""] * 3  # no differences of roll, pitch and yaw
    poses = zip(first.counted_pose, second.counted_pose, off, strict=False)
    return joints, [[f"{one:.4f}", f"{other:.4f}", difference] for one, other, difference in poses]


def _row(tag: str, name: str, unit: str, cells: Sequence[str]) -> str:
    numbers = "".join(f'<{tag} class="number">{escape(text)}</{tag}>' for text in cells)
    return f'<tr><{tag}>{escape(name)}</{tag}><{tag} class="muted">{escape(unit)}</{tag}>{numbers}</tr>'


def _beside(names: str, picture: str) -> str:
    return f'<div class="lanes"><div class="lane-names">{names}</div><div class="lane-picture">{picture}</div></div>'


def _name(text: str, height: int, colour: str = "var(--muted)", place: str = "center") -> str:
    return f'<div style="height:{height}px;align-items:{place};color:{colour}">{escape(text)}</div>'


def _svg(height: int, label: str, parts: Sequence[str]) -> str:
    view = f'viewBox="0 0 {WIDTH} {max(height, 1)}" height="{height}" preserveAspectRatio="none"'
    return f'<svg width="100%" {view} role="img" aria-label="{escape(label)}">{"".join(parts)}</svg>'


def _line(path: str, colour: str, width: float = 1.0, more: str = "") -> str:
    stroke = f'stroke="{colour}" stroke-width="{width:g}" vector-effect="non-scaling-stroke"'
    return f'<path d="{path}" fill="none" {stroke}{more}/>'


def _course(x: FloatArray, y: FloatArray) -> str:
    """Return the path of a step function: each value holds until the next instant, the last one to the end."""
    steps = "".join(f"H{across:.2f}V{down:.2f}" for across, down in zip(x[1:], y[1:], strict=True))
    return f"M{x[0]:.2f} {y[0]:.2f}{steps}H{WIDTH}"


def _across(counts: Int64Array, span: Span) -> FloatArray:
    return np.asarray(WIDTH * (counts - span.from_counts) / max(span.to_counts - span.from_counts, 1))


def _cursor(span: Span, counts: int, height: int) -> str:
    x = float(_across(np.array([counts]), span)[0])
    return _line(f"M{x:.2f} 0V{height}", "var(--trace)", 1.2, ' stroke-dasharray="4 3"')
