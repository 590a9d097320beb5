"""Fixtures of the packaging tests, each made once in a session."""

from pathlib import Path

import pytest

from tests.package.wheels import ROOT, build, install


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel of this checkout."""
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install that wheel; return the folder."""
    return install(wheel, tmp_path_factory.mktemp("installed"))
