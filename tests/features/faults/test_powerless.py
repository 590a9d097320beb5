"""Steps that a driver counts without current in its phases, since a wire is broken: the verdict tells them."""

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.host.verify.counted import powerless_steps
from tests.features.faults.short_runs import played


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
