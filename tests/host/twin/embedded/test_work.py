"""The work that an emulated run takes, in calls of functions: a bound that holds on a busy machine too."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.compiled import on_sources_only
from tests.work import function_calls


@pytest.mark.slow
@on_sources_only
def test_the_pull_along_a_line_takes_few_calls(fast_kernel: Kernel) -> None:
    """Ten seconds of six axes at 100 points a second: 7800 frames."""
    robot = load_robot("warehouse-scara")
    pull = plan(robot, make_job(robot, "pull-line"))
    execute(pull, "pull-line", kernel=fast_kernel)
    assert function_calls(lambda: execute(pull, "pull-line", kernel=fast_kernel)) <= 850_000
