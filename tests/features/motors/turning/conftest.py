"""One short run for all tests of motors after a run."""

import pytest

from steptwin.features.motors.turning import MotorRun, motors_of_run
from steptwin.host.verify import Comparison
from tests.features.motors.turning.short_runs import shoulder_turn


@pytest.fixture(scope="package")
def comparison() -> Comparison:
    """A turn of the teaching SCARA's shoulder by 30 degrees."""
    return shoulder_turn()


@pytest.fixture(scope="package")
def ran(comparison: Comparison) -> MotorRun:
    """Its motors."""
    robot = comparison.expected.robot
    assert robot is not None
    return motors_of_run(robot, comparison)
