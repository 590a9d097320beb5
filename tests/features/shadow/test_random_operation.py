"""Half a minute of random operation of machines of each kind; docs/shadow.md tells of hours."""

import pytest

from steptwin.controller.motion.backend import Kernel
from tests.features.shadow.random_operation import false_alarms


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["warehouse-scara", "corexy-gantry"])
def test_no_false_alarm(robot: str, fast_kernel: Kernel) -> None:
    assert false_alarms(robot, 0.5, 3, fast_kernel) == {300: [], 1500: []}
