"""The pictures in the folders of runs: drawing them takes longer than most runs, so only tests of them want them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

import pytest

from steptwin.host.record.folder import writing


@contextmanager
def with_pictures() -> Iterator[None]:
    """Let `run --out` draw its pictures while the block runs."""
    with _finding_by(find_spec):
        yield


@contextmanager
def without_pictures() -> Iterator[None]:
    """Let `run --out` write folders as if matplotlib were not installed, while the block runs."""
    with _finding_by(lambda _: None):
        yield


@contextmanager
def _finding_by(find: Callable[[str], object]) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writing, "find_spec", find)
        yield
