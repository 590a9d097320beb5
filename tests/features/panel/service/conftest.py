"""Fixtures of the tests of the service that need an operated board."""

from tests.host.operate.conftest import board, session

__all__ = ["board", "session"]
