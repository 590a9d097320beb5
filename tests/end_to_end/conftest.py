"""Fixtures for tests of whole runs."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.studies.papers.study import Runs


@pytest.fixture(scope="session")
def runs(fast_kernel: Kernel) -> Runs:
    """Return all jobs with default options; each is run once, when a test first asks for it."""
    return Runs(fast_kernel)
