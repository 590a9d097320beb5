"""The digest by which rows of different code are told apart."""

from pathlib import Path

import pytest

import steptwin
from steptwin.features.campaigns.row import Ended, Row
from steptwin.features.campaigns.sources import digest_of, source_version


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return a package as in a checkout, where its folders are links."""
    sources = {"controller/a.py": "1", "host/b/c.py": "2", "host/b/d.toml": "3", "host/b/c.pyc": "4", "bench/e.py": "5"}
    for name, text in sources.items():
        tmp_path.joinpath(name).parent.mkdir(parents=True, exist_ok=True)
        tmp_path.joinpath(name).write_text(text)
    package = tmp_path / "package"
    package.mkdir()
    for folder in ("controller", "host"):
        (package / folder).symlink_to(tmp_path / folder)
    return package


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("controller/a.py", True),
        ("host/b/c.py", True),
        ("host/b/d.toml", True),
        ("host/b/new.py", True),
        ("host/b/c.pyc", False),
        ("bench/e.py", False),
    ],
)
def test_sources_and_robot_files_count(package: Path, name: str, other: bool) -> None:
    before = digest_of(package)
    package.parent.joinpath(name).write_text("another")
    assert (digest_of(package) != before) == other


def test_names_count_and_contents_stay_apart(package: Path) -> None:
    before = digest_of(package)
    (package / "host" / "b" / "c.py").rename(package / "host" / "b" / "f.py")
    assert digest_of(package) != before


def test_a_row_has_the_version_of_this_code() -> None:
    version, _, digest = source_version().partition("+")
    assert version == steptwin.__version__
    assert digest == digest_of(Path(steptwin.__file__).parent)
    assert Row(1, "lab-scara", "spiral", "nothing", Ended.DONE).version == source_version()
