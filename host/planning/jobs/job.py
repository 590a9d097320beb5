"""A job: a name, and a function from a robot and options to a motion."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Generic

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.checks import check_positions
from steptwin.host.planning.drives import DriveLimits, check_drives
from steptwin.host.planning.jobs.options import (
    OptionField,
    Options,
    chosen,
    option_fields,
    parse_options,
    place_options,
)
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.whole import FASTEST, has_timer, motion_timer
from steptwin.host.planning.paths import OutOfReachError
from steptwin.host.robots.kinematics import Elbow, HybridArm, Scara, make_kinematics, within_limits
from steptwin.host.robots.robot import Robot


def with_elbow(robot: Robot, joints: FloatArray, elbow: Elbow) -> FloatArray:
    """Return joints of shape (joints,) with the same tool pose and slides as the given ones, and this elbow."""
    kinematics = make_kinematics(robot)
    solved: FloatArray = kinematics.solve(kinematics.forward(joints[np.newaxis]), elbow.value, joints).joints[0]
    return solved


def scara_reach_mm(robot: Robot) -> float:
    """Return the greatest distance of a SCARA's wrist from its shoulder; 0 for another mechanism."""
    kinematics = make_kinematics(robot)
    return kinematics.arm.reach_mm[1] if isinstance(kinematics, Scara) else 0.0


def in_reach(length_mm: float, paper_reach_mm: float) -> Callable[[Robot], float]:
    """Return a length scaled by a SCARA's reach, from the paper's robot."""
    return lambda robot: length_mm * (scara_reach_mm(robot) / paper_reach_mm)


def in_reach_at_most(length_mm: float, paper_reach_mm: float) -> Callable[[Robot], float]:
    """Return a length scaled by a SCARA's reach, at most the given one."""
    return lambda robot: length_mm * min(scara_reach_mm(robot) / paper_reach_mm, 1.0)


def in_station(axis: int, *place: Callable[[Robot], float]) -> Callable[[Robot], float]:
    """Return a function for x, y or z, by number, of a place from the base in the station's frame."""
    return lambda robot: float(robot.base.in_station(np.array([each(robot) for each in place]))[axis])


def fitted(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return joints of shape (joints,), each limited to its range."""
    lower, upper = ([getattr(joint, bound) for joint in robot.joints] for bound in ("lower", "upper"))
    return np.clip(joints, lower, upper)


HYBRID_RADIUS_MM: Final = 400.0
HYBRID_Z2_MAX_MM: Final = 150.0
HYBRID_STROKE_MM: Final = 500.0
HYBRID_REST_MM: Final = 280.0 + (350.0**2 - 150.0**2) ** 0.5
"""Dimensions of the reference arm of the jobs' poses: radius of the tool with the platform in the middle, travel of the
platform to each side, stroke of the sliders, and height of the tool with the sliders at 0.
"""


def hybrid_scale(robot: Robot) -> tuple[float, float, float, float]:
    """Return the scale of poses from the reference hybrid arm to this one.

    It has the factor of radii, the factors of radial and vertical distances from the middle, and the tool's rise with
    the sliders at 0, in mm.
    """
    arm = make_kinematics(robot)
    if not isinstance(arm, HybridArm):
        return 1.0, 1.0, 1.0, 0.0
    grown = arm.radius_mm / HYBRID_RADIUS_MM
    radial = min((arm.z2_max_mm / arm.radius_mm) / (HYBRID_Z2_MAX_MM / HYBRID_RADIUS_MM), 1.0)
    sliders = [robot.joint(name) for name in ("Z5", "Z6")]
    lower, upper = max(slider.lower for slider in sliders), min(slider.upper for slider in sliders)
    vertical = min((upper - lower) / HYBRID_STROKE_MM, 1.0)
    rest_mm = arm.height_mm + (arm.sliders.L_mm**2 - arm.sliders.h_mm**2) ** 0.5
    return grown, radial, vertical, rest_mm - HYBRID_REST_MM + (lower + upper) / 2.0


_LAW: Final = "law"
_PLANNED: Final = "planned"
"""Alternative to the fastest law for a job without laws."""
_TIMES: Final = ("duration_s", "ramp_s")
"""Options of a job's duration; with the fastest law, the path alone determines it."""


@dataclass(frozen=True, slots=True)
class Job(Generic[Options]):
    """A job of a kind of robot.

    Attributes:
        name: name on the command line.
        summary: summary, one line.
        options: frozen dataclass with fields of `steptwin.host.planning.jobs.options`, each with a default.
        build: returns the motion for a robot and options; raises InputError if it is impossible.
        intent: returns the job's intent for a feature besides the motion; None without one.
    """

    name: str
    summary: str
    options: type[Options]
    build: Callable[[Robot, Options], Motion]
    intent: Callable[[Robot, Options], Any] | None = None

    def make(self, robot: Robot, texts: Mapping[str, str], drives: DriveLimits | None = None) -> Motion:
        """Return the motion for options given as texts; raise InputError as `parse_options` and `build`.

        Errors about a place out of reach, or a joint beyond its limits, name the options to set.
        """
        options, is_fastest = self._read(robot, texts)
        check_drives(drives, is_fastest=is_fastest)
        places = place_options(self.options)
        try:
            motion = self.build(robot, options)
            if places:
                _check_limits(robot, motion)
        except OutOfReachError as error:
            hint = f"; the {'option sets' if len(places) == 1 else 'options set'} the place: {' '.join(places)}"
            raise InputError(f"{error}{hint if places else ''}") from error
        return motion_timer().again(robot, motion, drives) if is_fastest else motion

    def intended(self, robot: Robot, texts: Mapping[str, str]) -> Any:
        """Return the job's intent with these options; raise InputError as `parse_options`."""
        return None if self.intent is None else self.intent(robot, self._read(robot, texts)[0])

    def fields(self, robot: Robot) -> tuple[OptionField, ...]:
        """Return the options with their defaults and valid values for a robot; every job may have the fastest law."""
        own = {field.name: field for field in option_fields(self.options, robot)}
        law = own.get(_LAW, OptionField(_LAW, _PLANNED, (_PLANNED,)))
        return tuple(
            (own | {_LAW: replace(law, choices=(*law.choices, FASTEST) if has_timer() else law.choices)}).values()
        )

    def _read(self, robot: Robot, texts: Mapping[str, str]) -> tuple[Options, bool]:
        """Return the job's own options, and whether its path gets the fastest law."""
        own = {name.replace("-", "_"): text for name, text in texts.items()}
        fields = {field.name: field for field in self.fields(robot)}
        laws = fields[_LAW].choices
        is_fastest = _LAW in own and chosen(_LAW, own[_LAW], {law: law for law in laws}) == FASTEST
        if is_fastest:
            for name in _TIMES:
                if name in own and not fields[name].is_default(own[name]):
                    raise InputError(f"option {name}: law={FASTEST} takes as long as the robot needs; leave one out")
        if is_fastest or _PLANNED in laws:
            own.pop(_LAW, None)
        return parse_options(self.options, own, robot), is_fastest


_CHECKED: Final = 2000
"""Number of instants when the joints' limits are checked; the planner checks every millisecond."""


def _check_limits(robot: Robot, motion: Motion) -> None:
    """Raise OutOfReachError, as the planner does, if joints are clearly beyond their limits."""
    positions = motion.positions(np.linspace(0.0, motion.duration_s, _CHECKED))
    if not within_limits(robot.joints, positions).all():
        check_positions(robot, motion)
