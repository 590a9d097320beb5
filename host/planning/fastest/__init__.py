"""Motions as fast as the limits allow: paths through rounded corners, and their timing from rest to rest."""

from steptwin.host.planning.fastest.again import FASTEST, fastest_again
from steptwin.host.planning.fastest.chain import AVERAGE_S, ChainDrives, TimedChain, timed_chains
from steptwin.host.planning.fastest.contour import Contour, ContourPath, rounding_coefficients
from steptwin.host.planning.fastest.corners import Corner, CornerError, JointLeg, MotionLeg, ToolLeg
from steptwin.host.planning.fastest.drives import (
    AskedLimits,
    DriveAnswer,
    DriveLimits,
    LoadChange,
    MakeDrives,
    check_drives,
)
from steptwin.host.planning.fastest.executed import TimedPath, UntimedError, timed
from steptwin.host.planning.fastest.pieces import FollowedPath, Pace
from steptwin.host.planning.fastest.worthwhile_stops import StoppingPath, doubtful, worthwhile

__all__ = [
    "AVERAGE_S",
    "FASTEST",
    "AskedLimits",
    "ChainDrives",
    "Contour",
    "ContourPath",
    "Corner",
    "CornerError",
    "DriveAnswer",
    "DriveLimits",
    "FollowedPath",
    "JointLeg",
    "LoadChange",
    "MakeDrives",
    "MotionLeg",
    "Pace",
    "StoppingPath",
    "TimedChain",
    "TimedPath",
    "ToolLeg",
    "UntimedError",
    "check_drives",
    "doubtful",
    "fastest_again",
    "rounding_coefficients",
    "timed",
    "timed_chains",
    "worthwhile",
]
