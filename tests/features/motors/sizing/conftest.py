"""The short run of the tests of motors after a run, for the studies of motors."""

from tests.features.motors.turning.conftest import comparison, ran

__all__ = ["comparison", "ran"]
