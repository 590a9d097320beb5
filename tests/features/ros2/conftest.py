"""Fixtures of the tests that offer a machine to ROS: those of an operated board."""

from tests.host.operate.conftest import board, session, steptwin

__all__ = ["board", "session", "steptwin"]
