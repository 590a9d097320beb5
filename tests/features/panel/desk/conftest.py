"""Fixtures of the tests of the desk that need an operated board."""

from tests.host.operate.conftest import board, session

__all__ = ["board", "session"]
