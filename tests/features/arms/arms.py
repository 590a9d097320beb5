"""Six-axis arms that people build, by the makers' own numbers, as robot files of the kind `chain`.

Sources: AR4 mk3, `DHparams` of the Teensy sketch (modified DH) and JOINT_LIMIT_* of ar4_ros_driver; PAROL6,
PAROL6_ROBOT.py (standard DH and limits); Thor, thor.urdf.xacro; Dummy, the vectors L1_base to L6_wrist of
6dof_kinematic.cpp.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

import numpy as np

from steptwin.features.arms.six_axis_arm import SixAxisArm
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import MACHINES, load_robot, read_robot
from steptwin.host.robots.kinematics.kinds import make_kinematics
from steptwin.host.robots.robot import Robot

Limits = Sequence[tuple[float, float]]

_BOARD: Final = """
[board]
osc_pf = 330
steplen_ns = 33_000
stepspace_ns = 33_666
dirsetup_ns = 15_000
dirhold_ns = 15_000
step_rate_max_hz = 15_000
"""


def chain_text(
    chain: Mapping[str, str], limits: Limits, notation: str = "modified-dh", more: str = "", unit: str = "deg"
) -> str:
    """The text of a robot file; `chain` has the entries of each joint, `more` further keys of [kinematics]."""
    rows = "\n".join(f"{name} = {{ {entries} }}" for name, entries in chain.items())
    units = ["mm" if "slides = true" in entries else unit for entries in chain.values()]
    joints = "".join(
        f'[joints.{name}]\nunit = "{own}"\nlower = {low:.6f}\nupper = {high:.6f}\nspeed_max = 60.0\n'
        f"acceleration_max = 300.0\nfull_steps_per_rev = 200\nmicrosteps = 8\n"
        f"{'ratio = 10.0' if own == 'deg' else 'travel_per_turn = 40.0'}\n"
        for (name, (low, high)), own in zip(zip(chain, limits, strict=True), units, strict=True)
    )
    home = "".join(
        f"{name} = {min(max(0.0, low), high):.6f}\n" for name, (low, high) in zip(chain, limits, strict=True)
    )
    return (
        f'name = "arm"\ntitle = "an arm"\n[kinematics]\nkind = "chain"\nnotation = "{notation}"\n{more}\n'
        f"[kinematics.chain]\n{rows}\n{_BOARD}{joints}[home]\n{home}"
    )


def dh_entries(rows: Sequence[tuple[float, float, float, float]]) -> dict[str, str]:
    """The entries of rows theta, alpha, d, a."""
    return {
        f"J{i}": f"theta_deg = {theta}, alpha_deg = {alpha}, d_mm = {d}, a_mm = {a}"
        for i, (theta, alpha, d, a) in enumerate(rows, start=1)
    }


AR4_ROWS: Final = (
    (0.0, 0.0, 169.77, 0.0),
    (-90.0, -90.0, 0.0, 64.2),
    (0.0, 0.0, 0.0, 305.0),
    (0.0, -90.0, 222.63, 0.0),
    (0.0, 90.0, 0.0, 0.0),
    (180.0, -90.0, 41.0, 0.0),
)
"""theta, alpha, d, a in modified DH."""
PAROL6_ROWS: Final = (
    (0.0, -90.0, 110.5, 23.42),
    (0.0, 180.0, 0.0, 180.0),
    (0.0, 90.0, 0.0, -43.5),
    (0.0, -90.0, -176.35, 0.0),
    (0.0, 90.0, 0.0, 0.0),
    (0.0, 180.0, -62.8, -45.25),
)
"""theta, alpha, d, a in standard DH."""
DUMMY_ROWS: Final = (
    (0.0, -90.0, 109.0, 35.0),
    (-90.0, 0.0, 0.0, 146.0),
    (90.0, 90.0, 0.0, -52.0),
    (0.0, -90.0, 115.0, 0.0),
    (0.0, 90.0, 0.0, 0.0),
    (0.0, 0.0, 72.0, 0.0),
)
"""theta, alpha, d, a in standard DH."""
AR4_LIMITS: Final = ((-170, 170), (-42, 90), (-89, 52), (-180, 180), (-105, 105), (-180, 180))
PAROL6_LIMITS: Final = (
    (-123.046875, 123.046875), (-145.0088, -3.375), (107.866, 287.8675),
    (-105.46975, 105.46975), (-90, 90), (0, 360),
)  # fmt: skip
THOR_LIMITS: Final = ((-170, 170), (-90, 90), (-90, 90), (-170, 170), (-90, 90), (-170, 170))
DUMMY_LIMITS: Final = ((-170, 170), (-73, 90), (35, 180), (-180, 180), (-120, 120), (-720, 720))

_X, _Z = "axis = [1, 0, 0]", "axis = [0, 0, 1]"
THOR_CHAIN: Final = {
    "J1": _Z,
    "J2": f"xyz_mm = [0, 0, 202], {_X}",
    "J3": f"xyz_mm = [0, 0, 160], {_X}",
    "J4": _Z,
    "J5": f"xyz_mm = [0, 0, 194], {_X}",
    "J6": _Z,
}
TEXTS: Final = {
    "AR4": chain_text(dh_entries(AR4_ROWS), AR4_LIMITS),
    "PAROL6": chain_text(dh_entries(PAROL6_ROWS), PAROL6_LIMITS, "standard-dh"),
    "Thor": chain_text(THOR_CHAIN, THOR_LIMITS, "urdf", "tool = { xyz_mm = [0, 0, 13.5] }"),
    "Dummy": chain_text(dh_entries(DUMMY_ROWS), DUMMY_LIMITS, "standard-dh"),
}


@cache
def arm(name: str) -> Robot:
    """One of the arms, or one that StepTwin brings."""
    return load_robot(name) if name in MACHINES else read_robot(TEXTS[name])


def kinematics_of(robot: Robot) -> SixAxisArm:
    """The kinematics of a chain."""
    kinematics = make_kinematics(robot)
    assert isinstance(kinematics, SixAxisArm)
    return kinematics


def random_joints(robot: Robot, count: int, seed: int = 1) -> FloatArray:
    """Joint positions within the limits, shape (count, joints)."""
    lower, upper = ([getattr(joint, end) for joint in robot.joints] for end in ("lower", "upper"))
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))


def same_turn(joints: FloatArray) -> FloatArray:
    """Angles in [-180, 180)."""
    return np.asarray((joints + 180.0) % 360.0 - 180.0)
