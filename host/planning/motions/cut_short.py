"""A motion that ends early, where it stands: what a machine has done that never went on after a wait."""

from dataclasses import dataclass

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import Switching, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class CutShort:
    """The first part of a trajectory, up to an instant at which it stands; implements Trajectory.

    Attributes:
        trajectory: the trajectory itself.
        duration_s: duration of the part, a whole number of milliseconds.
    """

    trajectory: Trajectory
    duration_s: float

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The trajectory's joints."""
        return self.trajectory.joint_names

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The trajectory's breakpoints before the end."""
        return tuple(t_s for t_s in self.trajectory.breakpoints_s if t_s < self.duration_s)

    @property
    def switchings(self) -> tuple[Switching, ...]:
        """The trajectory's changes of outputs up to the end."""
        return tuple(change for change in self.trajectory.switchings if change.until_s <= self.duration_s)

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return self.trajectory.positions(t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return self.trajectory.velocities(t_s)
