"""A SCARA of 200 + 150 mm whose elbow motor sits on the base: its axis turns with the shoulder."""

from steptwin.host.robots import brought_text
from steptwin.host.robots.reader import parse_robot
from steptwin.host.robots.robot import Robot

DIRECT = "th2 = { th1 = 1.0 }"
"""A belt of 1:1 about the shoulder: elbow axis = th2 + th1."""
TWO_TO_ONE = "th2 = { th1 = 2.0 }"
"""A belt of 2:1 about the shoulder: elbow axis = th2 + 2 th1."""
STEPS_PER_DEG = 200 * 16 * 4 / 360
"""Of both arm axes."""
UNITS_PER_DEG = 200 * 16384 * 4 / 360


def coupled_text(coupling: str = DIRECT, **changes: str) -> str:
    """Return the robot file with a coupling; `changes` are lines of the joint th2."""
    text = brought_text("teaching-scara").replace('name = "teaching-scara"', 'name = "belt-scara"')
    text = text.replace("l1_mm = 95.0", "l1_mm = 200.0").replace("l2_mm = 100.0", "l2_mm = 150.0")
    lines = "".join(f"{key} = {value}\n" for key, value in changes.items())
    text = text.replace("[joints.th2] # elbow, belt\n", f"[joints.th2]\n{lines}")
    return f"{text}\n[coupling]\n{coupling}\n"


def coupled_robot(coupling: str = DIRECT, **changes: str) -> Robot:
    return parse_robot(coupled_text(coupling, **changes), "belt.toml")
