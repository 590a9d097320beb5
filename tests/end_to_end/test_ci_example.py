"""The example project of docs/ci.md: its own tests, with its own settings, pass."""

import shutil
import subprocess
import sys
from pathlib import Path

from tests.end_to_end.test_readme import ROOT

EXAMPLE = ROOT / "docs" / "examples" / "ci"


def test_the_example_passes(tmp_path: Path) -> None:
    project = tmp_path / "project"
    shutil.copytree(EXAMPLE, project)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider"],
        cwd=project,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[-1].startswith("5 passed")
