"""The example of docs/examples/c: its own tests pass, with the compiler of this computer."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.end_to_end.pages import ROOT
from tests.end_to_end.served import in_real_time

EXAMPLE = ROOT / "docs" / "examples" / "c"


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
@in_real_time
def test_a_master_in_c_moves_an_axis_of_a_served_board(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider", str(EXAMPLE)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[-1].startswith("2 passed")
