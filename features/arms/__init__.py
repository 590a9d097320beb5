"""Six-axis arms: closed-form branches of spherical and offset wrists, and numeric ones of other chains."""

from typing import Final

from steptwin.host.common.features import Feature

FEATURE: Final = Feature(
    name="arms",
)
