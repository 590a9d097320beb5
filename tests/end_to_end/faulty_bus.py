"""The drawer pull on a bus with faults."""

from typing import Final

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.faults.bus import FaultScript
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome

MS: Final = 72_000
"""Counts of the board's timer in a millisecond."""


def drawer_pull(kernel: Kernel, script: FaultScript) -> Outcome:
    """Run the drawer pull while the bus does what the script says."""
    robot = load_robot("warehouse-scara")
    return execute(plan(robot, make_job(robot, "pull-line", {})), "pull-line", kernel, bus_faults=script)
