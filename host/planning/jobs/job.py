"""A job: a name, and a function from a robot and options to a motion."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Generic

import numpy as np

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
from steptwin.host.robots.kinematics import within_limits
from steptwin.host.robots.robot import Robot

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
