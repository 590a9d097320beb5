"""Input shaping: motions are changed before they are checked, so that the machine does not oscillate at their ends.

It imports the core, `fastest`, whose shapers it uses, and `motors`, whose model may give a joint's frequency.
"""

from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.host.common.features import ChangedMotion
    from steptwin.host.planning.motion import Motion
    from steptwin.host.robots.robot import Robot

NAME: Final = "shaping"


def _section() -> Any:
    from steptwin.features.shaping.section import SHAPING_TABLE

    return SHAPING_TABLE


def _change_motion(robot: "Robot", motion: "Motion") -> "ChangedMotion | None":
    if NAME not in robot.sections:
        return None
    from steptwin.features.shaping.shaped_motion import shaped

    return shaped(robot, motion)


FEATURE: Final = Feature(name=NAME, needs=("fastest", "motors"), section=_section, change_motion=_change_motion)
