"""Six-axis arms: branches of spherical wrists in closed form, and those of nearly spherical wrists."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.host.robots.kinematics.kinds import Kind


def _kinematics() -> "Mapping[str, Kind]":
    from steptwin.features.arms.six_axis_arm import SixAxisArm
    from steptwin.host.robots.kinematics.kinds import Kind
    from steptwin.host.robots.kinematics.serial.chain_geometry import ChainGeometry

    summary = "1 to 8 joints in a row, turning or sliding: six-axis arms and others"
    return {"chain": Kind(summary, ChainGeometry, SixAxisArm.of)}


FEATURE: Final = Feature(name="arms", kinematics=_kinematics)
