"""See a motion of coupled joints as the motion of their axes."""

from dataclasses import dataclass

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import Switching, Trajectory
from steptwin.host.robots.coupling import Coupling


@dataclass(frozen=True, slots=True)
class AxisMotion:
    """A trajectory in axis positions instead of joint positions; implements Trajectory.

    Attributes:
        trajectory: the motion of the joints.
        coupling: how the axes follow them.
    """

    trajectory: Trajectory
    coupling: Coupling

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the axes, which are those of the joints."""
        return self.trajectory.joint_names

    @property
    def duration_s(self) -> float:
        """The motion's duration."""
        return self.trajectory.duration_s

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The motion's breakpoints."""
        return self.trajectory.breakpoints_s

    @property
    def switchings(self) -> tuple[Switching, ...]:
        """The motion's changes of outputs."""
        return self.trajectory.switchings

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return axis positions, of shape (n, axes)."""
        return self.coupling.to_axes(self.trajectory.positions(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return axis velocities, of shape (n, axes)."""
        return self.coupling.to_axes(self.trajectory.velocities(t_s))
