"""Parts at the presets of the classroom arm."""

from dataclasses import replace

from steptwin.features.shelf.jobs import missed_presets
from steptwin.host.robots import load_robot

ROBOT = load_robot("teaching-scara")


def test_parts_that_the_gripper_does_not_reach() -> None:
    """A longer arm comes elsewhere; both sides of the gripper's play."""
    assert missed_presets(ROBOT) == missed_presets(load_robot("lab-scara")) == []
    near, longer = (replace(ROBOT, geometry={**ROBOT.geometry, "l1_mm": l1_mm}) for l1_mm in (96.9, 97.1))
    assert missed_presets(near) == []
    assert missed_presets(longer)[0] == (
        "shelf.spots.qa: carry brings the gripper to x 197.1, y 0.0 mm, 2.1 mm away; it reaches 2 mm"
    )
