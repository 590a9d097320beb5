"""The example project of docs/ci.md: its own tests, with its own settings, pass."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.end_to_end.pages import ROOT, blocks_of, read_page

pytestmark = pytest.mark.live

PAGE = read_page("docs/ci.md")
EXAMPLE = ROOT / "docs" / "examples" / "ci"


def test_the_example_and_what_the_page_shows_pass(tmp_path: Path) -> None:
    project = tmp_path / "project"
    shutil.copytree(EXAMPLE, project, ignore=shutil.ignore_patterns("__pycache__"))
    shown = [content for language, content in blocks_of(PAGE) if language == "python"]
    for number, content in enumerate(shown):
        (project / "tests" / f"test_shown_{number}.py").write_text(content, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-rP", "-W", "error", "-p", "no:cacheprovider"],
        cwd=project,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert len(shown) == 2
    assert done.stdout.splitlines()[-1].startswith("7 passed")
    assert "WARNING" not in done.stdout  # the canopen library's logger warns of time-outs and of reading by SDO
