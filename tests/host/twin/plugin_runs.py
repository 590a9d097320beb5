"""Run tests that use the pytest plugin, in a file of their own."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client.monitor import Decoder
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest


def load_all(kernel: Kernel) -> None:
    """Import all that a board needs: pytester forgets a test's first imports, and numba cannot be imported twice."""
    Decoder({})
    BoardUnderTest(load_robot("lab-scara"), kernel=kernel)


def outcomes(pytester: pytest.Pytester, code: str, *options: str) -> pytest.RunResult:
    """Run tests in a file of their own; return the result."""
    pytester.makepyfile(code)
    return pytester.runpytest("-p", "no:cacheprovider", *options)
