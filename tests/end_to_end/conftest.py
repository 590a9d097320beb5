"""What the tests of whole runs share."""

import pytest

from docs.generate.runs import Runs
from steptwin.controller.backend import Kernel


@pytest.fixture(scope="session")
def runs(fast_kernel: Kernel) -> Runs:
    """Every job with its default options, each run once, when it is first asked for."""
    return Runs(fast_kernel)
