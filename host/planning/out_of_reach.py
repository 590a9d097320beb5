"""The error of a motion that leaves the robot's reach."""

from steptwin.host.common.errors import InputError


class OutOfReachError(InputError):
    """A path leaves the mechanism's reach or comes near a singularity, or a joint leaves its limits."""
