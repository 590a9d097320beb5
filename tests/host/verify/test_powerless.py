"""Steps that a driver counts without current in its phases: the verdict tells them."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import AxisEvidence, Phases
from steptwin.host.verify.counted import powerless_steps


@pytest.fixture(scope="module")
def axis(fast_kernel: Kernel) -> AxisEvidence:
    """An axis of a motion of a second."""
    robot = load_robot("teaching-scara")
    run = execute(plan(robot, make_job(robot, "carry", {})), "carry", fast_kernel)
    return run.comparison.evidence.axes[0]


def test_evidence_without_currents_has_none(axis: AxisEvidence) -> None:
    assert powerless_steps(axis, 0) == 0
    nothing = Phases(axis.phases.counts[:0], axis.phases.substeps[:0], axis.phases.a_ma[:0], axis.phases.b_ma[:0])
    assert powerless_steps(replace(axis, phases=nothing), 0) == 0


def test_steps_before_the_first_known_current_do_not_count(axis: AxisEvidence) -> None:
    """The driver is off at the end: that says nothing about what was before the first change."""
    steps = np.array([50, 100, 101, 150, 201, 250])
    angles = np.zeros(2, np.int32)
    off_at_the_end = Phases(np.array([100, 200]), angles, np.array([1500, 0], np.int16), np.zeros(2, np.int16))
    assert powerless_steps(replace(axis, step_counts=steps, phases=off_at_the_end), 0) == 2
    assert powerless_steps(replace(axis, step_counts=steps, phases=off_at_the_end), 202) == 1
