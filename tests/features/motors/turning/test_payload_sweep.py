"""The whole chain, from a robot's plan by the board's pulses to its rotors: heavier boxes slip earlier."""

import pytest

from steptwin import load_robot
from steptwin.features.motors.turning.after_run import MotionSlip, first_slip
from steptwin.features.motors.turning.driving import Driving
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.twin.embedded.execution import execute

UNTIL_S = 7.0
"""The box is taken at 1.25 s and lifted until 6.6 s: what follows is left out."""


@pytest.mark.slow
def test_the_first_slip_of_the_store_moves_earlier_with_the_payload() -> None:
    pytest.importorskip("numba")
    robot = load_robot("warehouse-scara")
    outcome = execute(plan(robot, make_job(robot, "store")), "store", cut_stream_s=UNTIL_S)
    driving = Driving.of(robot, outcome.comparison.evidence)
    taken_s = driving.seconds(int(driving.payload.counts[0]))
    slips = [first_slip(driving.with_payload(payload_kg)) for payload_kg in (0.0, 1.0, 2.5, 3.5, 5.0, 8.0, 16.0, 40.0)]
    assert slips[:2] == [None, None]
    found = [slip for slip in slips if isinstance(slip, MotionSlip)]
    assert len(found) == 6
    at_s = [slip.at_s for slip in found]
    assert at_s == sorted(at_s, reverse=True)
    assert len({round(each, 3) for each in at_s}) >= 4
    assert taken_s < at_s[-1]
    assert at_s[0] < UNTIL_S
