"""A job: a name, and a function from a robot and options to a trajectory."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Generic

import numpy as np

from steptwin.host.common.errors import InputError
from steptwin.host.planning.checks import check_positions
from steptwin.host.planning.errand import Carry
from steptwin.host.planning.jobs.options import OptionField, Options, option_fields, parse_options, place_options
from steptwin.host.planning.out_of_reach import OutOfReachError
from steptwin.host.planning.samples import Samples
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.kinematics import within_limits
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Job(Generic[Options]):
    """A job of a kind of robot.

    Attributes:
        name: name on the command line.
        summary: summary, one line.
        options: frozen dataclass whose fields are made by `steptwin.host.planning.jobs.options`, each with a default.
        build: function that returns the trajectory for a robot and options; it raises InputError if there is none.
        carries: function that returns the boxes that the job carries; None for a job that carries none.
    """

    name: str
    summary: str
    options: type[Options]
    build: Callable[[Robot, Options], Trajectory]
    carries: Callable[[Robot, Options], tuple[Carry, ...]] | None = None

    def make(self, robot: Robot, texts: Mapping[str, str]) -> Trajectory:
        """Return the trajectory for options given as texts; raise InputError as `parse_options` and `build` do.

        A place out of the robot's reach or a joint beyond its limits is an error that names the options to set.
        """
        options = parse_options(self.options, texts, robot)
        places = place_options(self.options)
        try:
            trajectory = self.build(robot, options)
            if places:
                _check_limits(robot, trajectory)
        except OutOfReachError as error:
            hint = f"; the {'option sets' if len(places) == 1 else 'options set'} the place: {' '.join(places)}"
            raise InputError(f"{error}{hint if places else ''}") from error
        return trajectory

    def carried(self, robot: Robot, texts: Mapping[str, str]) -> tuple[Carry, ...]:
        """Return the boxes that the job carries with these options; raise InputError as `parse_options` does."""
        return () if self.carries is None else self.carries(robot, parse_options(self.options, texts, robot))

    def fields(self, robot: Robot) -> tuple[OptionField, ...]:
        """Return the options with their defaults and valid values for a robot."""
        return option_fields(self.options, robot)


_CHECKED: Final = 2000
"""Number of instants at which the joints' limits are checked; the planner checks every millisecond."""


def _check_limits(robot: Robot, trajectory: Trajectory) -> None:
    """Raise OutOfReachError, as the planner does, if the joints' limits are clearly left."""
    positions = trajectory.positions(np.linspace(0.0, trajectory.duration_s, _CHECKED))
    if not within_limits(robot.joints, positions).all():
        check_positions(robot, Samples.of(trajectory, np.array([round(1000 * trajectory.duration_s)])))
