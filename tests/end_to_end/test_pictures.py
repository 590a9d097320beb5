"""Each picture of a page is the one that its code draws today."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.end_to_end.pages import ROOT

PIL: Any = pytest.importorskip("PIL.Image", reason="the extra `plot` (matplotlib) is not installed")

ELSEWHERE = {
    "bench-growth.png": "python -m steptwin.bench.benchmark_pictures: times of this computer",
    "bench-edges.png": "python -m steptwin.bench.benchmark_pictures",
    "bench-timing.png": "python -m steptwin.bench.benchmark_pictures",
    "campaign-margins.png": "steptwin campaign report, of 10 000 runs",
    "campaign-rates.png": "steptwin campaign report, of 10 000 runs",
    "replay-view.png": "python -m docs.generate.panel_pictures, in a browser",
}
"""Pictures that `make docs` does not draw, with the command that does; those of the panel are made in a browser."""
SHADE_MAX = 6.0
"""Greatest mean difference of a picture, of 255 shades, that another version of a font or of matplotlib makes."""


def shades(path: Path) -> Any:
    """Return a picture's grey shades at a quarter of its size, where letters are but grey."""
    with PIL.open(path) as picture:
        grey = picture.convert("L")
        return np.asarray(grey.resize((max(grey.width // 4, 1), max(grey.height // 4, 1))), dtype=np.float64)


@pytest.mark.slow
def test_make_docs_draws_the_pictures_of_the_pages(tmp_path: Path) -> None:
    """In a copy of docs/ without pictures."""
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("*.png", "*.gif", "__pycache__"))
    done = subprocess.run(
        [sys.executable, "-m", "docs.generate"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    ours, drawn = ROOT / "docs" / "pictures", tmp_path / "docs" / "pictures"
    names = {path.name for path in ours.iterdir() if path.is_file()}
    assert {path.name for path in drawn.iterdir() if path.is_file()} == names - set(ELSEWHERE)
    other = {}
    for path in drawn.iterdir():
        if path.is_file():
            now, then = shades(path), shades(ours / path.name)
            off = float(np.abs(now - then).mean()) if now.shape == then.shape else 255.0
            if off > SHADE_MAX:
                other[path.name] = off
    assert other == {}
