"""What the tests of pages share."""

import gc

import pytest


@pytest.fixture(autouse=True, scope="module")
def _spare_what_lives() -> None:
    """Keep what other tests have left alive from the collector: each simulated page collects all garbage twice."""
    gc.collect()
    gc.freeze()
