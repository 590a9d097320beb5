"""The examples of docs/examples/python run as they are, each in a process of its own."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.end_to_end.pages import ROOT, read_page

EXAMPLES = ROOT / "docs" / "examples" / "python"


def printed(words: list[str], folder: Path) -> str:
    """Run Python in an empty folder, with warnings as errors; return what it prints."""
    done = subprocess.run(
        [sys.executable, "-W", "error", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_example_is_named_on_the_page_and_uses_public_names_only() -> None:
    page = read_page("docs/api.md")
    for path in EXAMPLES.iterdir():
        assert path.name == "__pycache__" or f"(examples/python/{path.name})" in page
        if path.suffix in {".py", ".ipynb"}:
            assert not re.findall(r"(?:from|import) steptwin\.\w+", path.read_text(encoding="utf-8"))


def test_a_robot_of_one_s_own_draws_a_star(tmp_path: Path) -> None:
    *axes, verdict = printed([str(EXAMPLES / "own_robot.py")], tmp_path).splitlines()
    assert verdict == "PASSED"
    assert [line.partition(":")[0] for line in axes] == ["X", "Y", "Z"]
    assert all(line.endswith(", 0 broken limits") for line in axes)


def test_a_master_of_one_s_own_moves_an_axis(tmp_path: Path) -> None:
    assert printed([str(EXAMPLES / "own_master.py")], tmp_path) == "node 0x11 is at 1638400 units, 100 full steps\n"


def test_a_campaign_of_one_s_own(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra `campaign` is not installed")
    words = ["-m", "steptwin", "campaign", str(EXAMPLES / "evening.toml"), "--runs", "4", "--out", "evening"]
    done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "4 of 4 runs" in done.stdout
    assert "PASSED: nothing failed in silence" in done.stdout


def test_the_notebook_s_cells_run_in_their_order(tmp_path: Path) -> None:
    """As a program, since a notebook's server is no part of what is tried; it is stored without outputs."""
    pytest.importorskip("matplotlib", reason="the extra `plot` (matplotlib) is not installed")
    notebook = json.loads((EXAMPLES / "a_run.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["outputs"] for cell in cells] == [[]] * len(cells)
    pieces = ["".join(cell["source"]) for cell in cells]
    code = "\n".join(["import matplotlib", "matplotlib.use('agg')", *pieces, "plt.savefig('cell.png')"])
    printed(["-c", code], tmp_path)
    assert (tmp_path / "cell.png").stat().st_size > 5_000
