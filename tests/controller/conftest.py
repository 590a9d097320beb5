"""Fixtures for the tests of the firmware."""

import pytest

from steptwin.controller.motion.backend import Kernel
from tests.controller.bench_board import BenchBoard


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    """A board of one axis."""
    return BenchBoard(fast_kernel)


@pytest.fixture
def pair(fast_kernel: Kernel) -> BenchBoard:
    """A board of two axes."""
    return BenchBoard(fast_kernel, axes=2)
