"""The examples of docs/examples/python run as they are."""

import json
import re
import runpy
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT, read_page, run_python

EXAMPLES = ROOT / "docs" / "examples" / "python"


def test_every_example_is_named_on_the_page_and_uses_public_names_only() -> None:
    page = read_page("docs/api.md")
    for path in EXAMPLES.iterdir():
        assert path.name == "__pycache__" or f"(examples/python/{path.name})" in page
        if path.suffix in {".py", ".ipynb"}:
            assert not re.findall(r"(?:from|import) steptwin\.\w+", path.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_robot_of_one_s_own_draws_a_star(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "own_robot.py"), run_name="__main__")
    *axes, verdict = capsys.readouterr().out.splitlines()
    assert verdict == "PASSED"
    assert [line.partition(":")[0] for line in axes] == ["X", "Y", "Z"]
    assert all(line.endswith(", 0 broken limits") for line in axes)


@pytest.mark.live
def test_a_master_of_one_s_own_moves_an_axis(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "own_master.py"), run_name="__main__")
    assert capsys.readouterr().out == "node 0x11 is at 1638400 units, 100 full steps\n"


@pytest.mark.slow
def test_a_campaign_of_one_s_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed", reason="the extra `campaign` is not installed")
    words = ["--runs", "4", "--workers", "1", "--out", str(tmp_path / "evening")]
    assert run(["campaign", str(EXAMPLES / "evening.toml"), *words]) == 0
    out = capsys.readouterr().out
    assert "4 of 4 runs" in out
    assert "PASSED: nothing failed in silence" in out


@pytest.mark.slow
def test_the_notebook_s_cells_run_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a program, since a notebook's server is no part of what is tried; it is stored without outputs."""
    pytest.importorskip("matplotlib", reason="the extra `plot` (matplotlib) is not installed")
    notebook = json.loads((EXAMPLES / "a_run.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["outputs"] for cell in cells] == [[]] * len(cells)
    pieces = ["".join(cell["source"]) for cell in cells]
    code = "\n".join(["import matplotlib", "matplotlib.use('agg')", *pieces, "plt.savefig('cell.png')"])
    monkeypatch.chdir(tmp_path)
    run_python(code, tmp_path)
    assert (tmp_path / "cell.png").stat().st_size > 5_000
