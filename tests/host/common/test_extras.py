"""How an extra is installed, by how the package was."""

import json
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from steptwin.host.common import extras
from steptwin.host.common.extras import installing

CHECKOUT = Path(extras.__file__).resolve().parents[2]


class Installed:
    """The metadata of a package that was installed from somewhere."""

    def __init__(self, url: object = None) -> None:
        self._url = url

    def __call__(self, _name: str) -> "Installed":
        return self

    def read_text(self, _name: str) -> str | None:
        return None if self._url is None else json.dumps(self._url)


@pytest.fixture(autouse=True)
def _pip(monkeypatch: pytest.MonkeyPatch) -> None:
    """An active environment."""
    monkeypatch.setattr("shutil.which", lambda _: str(Path(sys.executable).parent / "pip"))


def test_in_a_checkout(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Also beside it: `steptwin` is no name that an index knows."""
    monkeypatch.chdir(CHECKOUT)
    assert installing("fast", "plot") == "pip install -e '.[fast,plot]'"
    assert installing("panel", make="panel") == "make panel, or pip install -e '.[panel]'"
    monkeypatch.chdir(tmp_path)
    assert installing("panel", make="panel") == f"pip install -e '{CHECKOUT}[panel]'"


@pytest.mark.parametrize(
    ("installed", "command"),
    [
        (Installed(), "pip install 'steptwin[plot]'"),
        (Installed({"url": "file:///a/s.whl", "archive_info": {}}), "pip install 'steptwin[plot] @ file:///a/s.whl'"),
        (
            Installed({"url": "https://h/s", "vcs_info": {"vcs": "git", "commit_id": "ab12"}}),
            "pip install 'steptwin[plot] @ git+https://h/s@ab12'",
        ),
    ],
)
def test_of_an_installed_package(installed: Installed, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "_checkout", lambda: None)
    monkeypatch.setattr(extras, "distribution", installed)
    assert installing("plot") == command


def test_of_a_package_without_metadata(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_name: str) -> None:
        raise PackageNotFoundError

    monkeypatch.setattr(extras, "_checkout", lambda: None)
    monkeypatch.setattr(extras, "distribution", missing)
    assert installing("plot") == "pip install 'steptwin[plot]'"


def test_by_another_pip(monkeypatch: pytest.MonkeyPatch) -> None:
    """A venv that is not active: `pip` would be another Python's."""
    monkeypatch.setattr("shutil.which", lambda _: "/elsewhere/pip")
    monkeypatch.setattr(sys, "executable", "/opt/venv/bin/python")
    monkeypatch.setattr(sys, "prefix", "/opt/venv")
    monkeypatch.chdir("/")
    assert installing("m3") == f"opt/venv/bin/python -m pip install -e '{CHECKOUT}[m3]'"
