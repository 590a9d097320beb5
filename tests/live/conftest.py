"""Fixtures for tests of programs as processes."""

from collections.abc import Iterator

import pytest

from tests.end_to_end.served import kept_servers


@pytest.fixture(autouse=True, scope="module")
def _no_server_left() -> Iterator[None]:
    """End the servers that the tests of a file have shared."""
    with kept_servers():
        yield
