"""Steps that a driver counts without current in its phases: the verdict tells them."""

from dataclasses import replace

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import Phases
from steptwin.host.verify.counted import powerless_steps
from tests.features.faults.short_runs import carry, played


def test_steps_without_current_are_told(fast_kernel: Kernel) -> None:
    """The wire of ENABLE is broken for 0.3 s; the driver's own count is as planned."""
    outcome, _ = played(
        fast_kernel,
        '[[fault]]\nat_s = 0.3\nfor_s = 0.3\ndo = "wire"\njoint = "th1"\nwire = "enable"\ncondition = "broken"\n',
    )
    th1 = outcome.comparison.evidence.axes[0]
    start_counts = outcome.comparison.evidence.start_counts
    times_s = (th1.step_counts - start_counts) / 72e6
    between = np.count_nonzero((times_s > 0.3 + 250e-6) & (times_s < 0.6))
    count = powerless_steps(th1, start_counts)
    assert between <= count <= between + 2
    assert outcome.report.reasons == (
        f"th1: {count} steps came while the driver's outputs were off: the motor did not follow",
    )


def test_evidence_without_currents_has_none(fast_kernel: Kernel) -> None:
    axis = execute(carry(), "carry", fast_kernel).comparison.evidence.axes[0]
    assert powerless_steps(axis, 0) == 0
    nothing = Phases(axis.phases.counts[:0], axis.phases.substeps[:0], axis.phases.a_ma[:0], axis.phases.b_ma[:0])
    assert powerless_steps(replace(axis, phases=nothing), 0) == 0


def test_steps_before_the_first_known_current_do_not_count(fast_kernel: Kernel) -> None:
    """The driver is off at the end: that says nothing about what was before the first change."""
    axis = execute(carry(), "carry", fast_kernel).comparison.evidence.axes[0]
    steps = np.array([50, 100, 101, 150, 201, 250])
    angles = np.zeros(2, np.int32)
    off_at_the_end = Phases(np.array([100, 200]), angles, np.array([1500, 0], np.int16), np.zeros(2, np.int16))
    assert powerless_steps(replace(axis, step_counts=steps, phases=off_at_the_end), 0) == 2
    assert powerless_steps(replace(axis, step_counts=steps, phases=off_at_the_end), 202) == 1
