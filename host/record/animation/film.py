"""The frames of an animation as arrays, and the camera: the arm, the boxes around it and both paths of the tool.

Pictures are drawn without perspective, so that they are true to scale.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, isfinite
from reprlib import repr as short
from typing import Final, Self

import numpy as np

from steptwin.host.common import numbers
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import at_least, nearest_within, outside, prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder import StoredRun
from steptwin.host.record.path_error import PathError, heading, path_error, round_below
from steptwin.host.record.recorded_machine import RecordedMachine
from steptwin.host.robots.kinematics import ArmPart, Role
from steptwin.host.verify import AxisEvidence, Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND

ELEVATION_MAX_DEG: Final = 90.0


@dataclass(frozen=True, slots=True)
class Camera:
    """The direction from the scene to the camera.

    Attributes:
        azimuth_deg: about the vertical, from the x axis.
        elevation_deg: above the horizontal; 90 looks down.

    Raises:
        InputError: an elevation beyond 90 degrees.
    """

    azimuth_deg: float
    elevation_deg: float

    def __post_init__(self) -> None:
        if not -ELEVATION_MAX_DEG <= self.elevation_deg <= ELEVATION_MAX_DEG:
            limits = (-ELEVATION_MAX_DEG, ELEVATION_MAX_DEG, "deg")
            raise InputError(
                f"elevation {outside(self.elevation_deg, *limits)}{nearest_within(self.elevation_deg, *limits)}"
            )

    @classmethod
    def named(cls, text: str) -> Self:
        """Return a camera by its name, or by two numbers `AZIMUTH,ELEVATION`; raise InputError for another text."""
        if text in CAMERAS:
            return cls(*CAMERAS[text])
        angles = text.split(",")
        if len(angles) != 2:
            names = ", ".join(CAMERAS)
            raise InputError(f"camera={short(text)}: is none of {names}, nor AZIMUTH,ELEVATION in degrees")
        with prefixed(f"camera={text}: "):
            return cls(*map(numbers.finite_number, angles))

    @property
    def basis(self) -> FloatArray:
        """Unit vectors to the right, upwards and towards the camera, the rows of a matrix of shape (3, 3)."""
        azimuth_rad, elevation_rad = np.deg2rad(self.azimuth_deg), np.deg2rad(self.elevation_deg)
        c, s, ce, se = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(elevation_rad), np.sin(elevation_rad)
        return np.array([[-s, c, 0.0], [-se * c, -se * s, ce], [ce * c, ce * s, se]])

    def seen(self, points_mm: FloatArray) -> FloatArray:
        """Return places in the picture, to the right and upwards in mm, and the depth towards the camera.

        Points and result have the shape (..., 3).
        """
        return np.asarray(points_mm @ self.basis.T)


CAMERAS: Final = {"iso": (-60.0, 30.0), "top": (-90.0, 90.0), "front": (-90.0, 0.0), "side": (0.0, 0.0)}
"""Azimuth and elevation of the cameras with names; the front is seen along the y axis, the side against the x axis."""


@dataclass(frozen=True, slots=True, eq=False)
class ShownBox:
    """A box at some instants: its edges, shape (12, 2, 3), and how far it has moved, shape (instants, 3)."""

    name: str
    edges_mm: FloatArray
    shifts_mm: FloatArray

    @property
    def moves(self) -> bool:
        """True if the tool moves it."""
        return bool(self.shifts_mm.any())


def shown_boxes(machine: RecordedMachine, times_s: FloatArray) -> tuple[ShownBox, ...]:
    """Return the boxes around a machine at times of its motion, shape (instants,)."""
    return tuple(
        ShownBox(name, machine.robot.boxes[name].edges_mm, shifts_mm)
        for name, shifts_mm in machine.box_shifts_mm(times_s).items()
    )


def extent_mm(parts: Iterable[ArmPart], boxes: Iterable[ShownBox], path: PathError, gain: float) -> FloatArray:
    """Return the points that pictures must hold, shape (n, 3), all of them finite.

    A mechanism that its counts pull apart has no place. Guides that are longer than all that moves, such as a rail,
    are left out, and boxes unless one of them moves.

    Args:
        parts: the machine's parts at some instants.
        boxes: the boxes around it at the same instants.
        path: the tool's path, and its error.
        gain: factor by which the error is magnified.
    """
    parts, boxes = tuple(parts), tuple(boxes)
    moving = [part.points_mm.reshape(-1, 3) for part in parts if part.role is not Role.GUIDE]
    shown = _finite(np.concatenate([*moving, path.planned_mm, path.counted_mm(gain)]))
    size_mm = np.linalg.norm(np.ptp(shown, axis=0))
    guides = [part.points_mm for part in parts if part.role is Role.GUIDE]
    short = [points.reshape(-1, 3) for points in guides if _length_mm(points) <= size_mm]
    drawn = boxes if any(box.moves for box in boxes) else ()
    corners = [(box.edges_mm + shift).reshape(-1, 3) for box in drawn for shift in _extremes(box.shifts_mm)]
    return _finite(np.concatenate([shown, *short, *corners]))


def _finite(points_mm: FloatArray) -> FloatArray:
    return points_mm[np.isfinite(points_mm).all(axis=1)]


def _length_mm(points_mm: FloatArray) -> float:
    """Return the distance between the ends of a part, the greatest of all instants."""
    return float(np.linalg.norm(points_mm[:, -1] - points_mm[:, 0], axis=1).max())


def _extremes(shifts_mm: FloatArray) -> FloatArray:
    return np.array([shifts_mm.min(axis=0), shifts_mm.max(axis=0)])


FPS: Final = 20.0
FPS_MAX: Final = 100.0
USUAL_LENGTH_S: Final = 10.0
"""Longest animation if the user does not choose the speed."""

FRAMES_MAX: Final = 6000
"""Largest number of frames: five minutes at the usual rate, and several minutes of drawing."""

PATH_INSTANTS: Final = 3001

_GRID_LINES: Final = 6
"""Least number of lines of the ground's grid along its longer side."""

_SPEEDS: Final = tuple(step * 10.0**decade for decade in range(-2, 6) for step in (1, 2, 5))


@dataclass(frozen=True, slots=True)
class Shot:
    """The choices of a user for an animation.

    Attributes:
        fps: frames a second.
        speed: seconds of the motion in a second of the animation; None: a round one, so that it lasts some seconds.
        from_s: first time of the motion; None: its start.
        to_s: last time of the motion; None: its end.
        gain: factor by which the path's error is magnified; None: a round one that makes it visible.
        frames: whether the frames of base, joints and tool are shown.
        pulses_ms: time before each instant when the drivers' CLK pins are shown; None: they are not.
    """

    fps: float = FPS
    speed: float | None = None
    from_s: float | None = None
    to_s: float | None = None
    gain: float | None = None
    frames: bool = False
    pulses_ms: float | None = None


PULSES_MS_MAX: Final = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class PulseRow:
    """The CLK pin of an axis: its name, and the times of its edges in the motion, each of shape (pulses,)."""

    name: str
    rises_s: FloatArray
    falls_s: FloatArray

    def levels(self, from_s: float, to_s: float) -> FloatArray:
        """Return the pin's line within a window: times from its end, 0 or less, and levels, of shape (points, 2)."""
        first, last = np.searchsorted(self.falls_s, from_s), np.searchsorted(self.rises_s, to_s)
        rises, falls = self.rises_s[first:last], self.falls_s[first:last]
        corners_s = np.repeat(np.column_stack([rises, falls]).ravel(), 2).clip(from_s, to_s)
        levels = np.tile([0.0, 1.0, 1.0, 0.0], len(rises))
        times_s = np.concatenate([[from_s], corners_s, [to_s]]) - to_s
        return np.column_stack([times_s, np.concatenate([[0.0], levels, levels[-1:] if falls.size else [0.0]])])


USUAL_SHOT: Final = Shot()


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """An animation without its drawing.

    Attributes:
        title: robot and job.
        times_s: shape (frames,), the motion's time at each frame.
        fps: frames a second.
        speed: seconds of the motion in a second of the animation.
        parts: the machine's parts at every frame.
        marks: the axes of its joints, and its frames if they are to be shown.
        boxes: the boxes around it.
        path: the tool's path over the whole motion, and its error.
        path_until: shape (frames,), number of the path's points that each frame has behind it.
        gain: factor by which the path's error is to be magnified.
        pulses: the CLK pins, if they are to be shown.
        pulses_ms: time before each instant when they are shown.
    """

    title: str
    times_s: FloatArray
    fps: float
    speed: float
    parts: tuple[ArmPart, ...]
    marks: tuple[ArmPart, ...]
    boxes: tuple[ShownBox, ...]
    path: PathError
    path_until: Int64Array
    gain: float
    pulses: tuple[PulseRow, ...] = ()
    pulses_ms: float = 0.0

    @property
    def grid_mm(self) -> float:
        """Distance of the lines of the ground's grid."""
        return round_below(float(np.ptp(self.extent_mm(), axis=0).max()) / _GRID_LINES)

    def extent_mm(self) -> FloatArray:
        """Return the points that pictures must hold, shape (n, 3), all of them finite."""
        return extent_mm(self.parts, self.boxes, self.path, self.gain)


def make_film(run: StoredRun, shot: Shot = USUAL_SHOT) -> Film:
    """Return the animation of a stored run; raise InputError for times, a rate or a speed that make none."""
    machine = RecordedMachine.of(run)
    first_s, last_s = _span_s(machine.duration_s, shot)
    times_s, speed = _times_s(first_s, last_s, shot)
    path_s = np.linspace(0.0, machine.duration_s, PATH_INSTANTS)
    path = path_error(machine.comparison, path_s)
    if shot.gain is not None and not (isfinite(shot.gain) and 1.0 <= shot.gain <= 1e9):
        raise InputError(f"gain={shot.gain:g} is outside 1..1e9")
    if shot.pulses_ms is not None and not 0.0 < shot.pulses_ms <= PULSES_MS_MAX:
        raise InputError(f"pulses_ms={shot.pulses_ms:g} is not above 0, or above {PULSES_MS_MAX:g} ms")
    return Film(
        title=heading(run.report.run, *(["counts without a plan"] if run.no_plan else [])),
        times_s=times_s,
        fps=shot.fps,
        speed=speed,
        parts=machine.links(times_s),
        marks=machine.marks(times_s, frames=shot.frames),
        boxes=shown_boxes(machine, times_s),
        path=path,
        path_until=2 * np.searchsorted(path_s, times_s, side="right"),
        gain=path.gain if shot.gain is None else shot.gain,
        pulses=() if shot.pulses_ms is None else _pulse_rows(machine.comparison.evidence),
        pulses_ms=shot.pulses_ms or 0.0,
    )


def _pulse_rows(evidence: Evidence) -> tuple[PulseRow, ...]:
    """Return the CLK pins of all axes by the motion's time; a pulse that has no end yet is left out."""
    return tuple(
        PulseRow(axis.name, *(_motion_s(counts[: axis.clk_fall_counts.size], evidence) for counts in _clk(axis)))
        for axis in evidence.axes
    )


def _clk(axis: AxisEvidence) -> tuple[Int64Array, Int64Array]:
    return axis.clk_rise_counts, axis.clk_fall_counts


def _motion_s(counts: Int64Array, evidence: Evidence) -> FloatArray:
    return np.asarray((counts - evidence.start_counts) / COUNTS_PER_SECOND)


def _span_s(duration_s: float, shot: Shot) -> tuple[float, float]:
    first_s = 0.0 if shot.from_s is None else shot.from_s
    last_s = duration_s if shot.to_s is None else shot.to_s
    for name, t_s in (("from_s", first_s), ("to_s", last_s)):
        if not 0.0 <= t_s <= duration_s:
            raise InputError(f"{name}={t_s:g} s: the motion goes from 0 to {duration_s:g} s")
    if shot.from_s is not None and not first_s < last_s:
        raise InputError(f"from_s={first_s:g} s is not before {last_s:g} s")
    return first_s, last_s


def _times_s(first_s: float, last_s: float, shot: Shot) -> tuple[FloatArray, float]:
    """Return the motion's time at each frame, and the speed."""
    if not 1.0 <= shot.fps <= FPS_MAX:
        raise InputError(f"fps={shot.fps:g} is outside 1..{FPS_MAX:g} frames a second")
    span_s = last_s - first_s
    speed = next(each for each in _SPEEDS if span_s <= each * USUAL_LENGTH_S) if shot.speed is None else shot.speed
    if not (isfinite(speed) and speed > 0.0):
        raise InputError(f"speed={speed:g} is not above 0")
    frames = span_s * shot.fps / speed
    if frames > FRAMES_MAX:
        raise InputError(
            f"speed={speed:g} makes {frames:.3g} frames, more than {FRAMES_MAX}:"
            f" speed={at_least(span_s * shot.fps / FRAMES_MAX)} would do"
        )
    return np.append(first_s + np.arange(ceil(frames)) * speed / shot.fps, last_s), speed
