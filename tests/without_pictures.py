"""Runs without pictures: drawing them takes longer than most runs."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from steptwin.host.record.folder import writing


@contextmanager
def without_pictures() -> Iterator[None]:
    """Let `run --out` write folders as if matplotlib were not installed, while the block runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writing, "find_spec", lambda _: None)
        yield
