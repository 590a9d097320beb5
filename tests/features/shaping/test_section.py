"""The table [shaping] of a robot file: what it may say, and what is refused."""

import pytest

from steptwin.features.shaping.section import JointShaping, Shaping
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot, parse_robot
from steptwin.host.robots.robot import Robot


def gantry(table: str) -> Robot:
    """Return the CoreXY gantry with this table."""
    return parse_robot(f"{load_robot('corexy-gantry').toml}\n{table}", "own.toml")


def test_each_joint_has_its_own_shaper() -> None:
    robot = gantry(
        '[shaping.X]\nkind = "mzv"\nfrequency_hz = 45.0\ndamping = 0.05\n[shaping.Y]\nkind = "ei"\nfrequency_hz = 32'
    )
    assert robot.sections["shaping"] == Shaping(
        {"X": JointShaping("mzv", 45.0, 0.05), "Y": JointShaping("ei", 32.0)}  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('x.kind = "zv"\nx.frequency_hz = 40', "shaping: joint 'x' is unknown: did you mean X?"),
        (
            'X.kind = "zvd"\nX.frequency_hz = 40',
            "shaping.X.kind: 'zvd' is not one of zv, mzv, ei: did you mean zv or mzv?",
        ),
        ('X.kind = "zv"', "shaping.X.frequency_hz: is missing, such as frequency_hz = 45.0; or from = 'motors'"),
        (
            'X.kind = "zv"\nX.from = "motors"\nX.damping = 0.1',
            "shaping.X.damping: from = 'motors' computes it: leave one of both out",
        ),
        (
            'X.kind = "zv"\nX.from = "motors"',
            "shaping.X.from: dynamics: is missing: the supply of the motors is unknown (docs/motors.md)",
        ),
        (
            'X.kind = "zv"\nX.frequency_hz = 0.5',
            "shaping.X.frequency_hz: 0.5 Hz is outside 1..200 Hz; the nearest is 1 Hz",
        ),
        (
            'X.kind = "zv"\nX.frequency_hz = 200.1',
            "shaping.X.frequency_hz: 200.1 Hz is outside 1..200 Hz; the nearest is 200 Hz",
        ),
        (
            'X.kind = "zv"\nX.frequency_hz = 40\nX.damping = 0.91',
            "shaping.X.damping: 0.91 is outside 0..0.9; the nearest is 0.9",
        ),
        (
            'X.kind = "zv"\nX.frequency = 40',
            "shaping.X.frequency: key 'frequency' is unknown: did you mean frequency_hz?",
        ),
    ],
)
def test_a_wrong_table_is_refused_with_the_nearest_right_one(table: str, message: str) -> None:
    with pytest.raises(InputError) as refused:
        gantry(f"[shaping]\n{table}")
    assert str(refused.value) == f"own.toml: {message}"


@pytest.mark.parametrize("hz", [1.0, 200.0])
def test_the_limits_themselves_are_right(hz: float) -> None:
    gantry(f'[shaping.X]\nkind = "ei"\nfrequency_hz = {hz}\ndamping = 0.9')
