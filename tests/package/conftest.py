"""Fixtures of the packaging tests: each is built once in a session."""

from pathlib import Path

import pytest

from tests.package.wheels import ROOT, build, install


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout."""
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which that wheel is installed."""
    return install(wheel, tmp_path_factory.mktemp("installed"))
