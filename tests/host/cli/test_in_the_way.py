"""What is in the way of the files of --out is told before the work, not after it."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.end_to_end.command_line import refusal
from tests.run_pictures import with_pictures

PLOT = pytest.mark.skipif(not find_spec("matplotlib"), reason="the extra `plot` is not installed")


def _nothing(*_: Any, **__: Any) -> None:
    pytest.fail("the work has begun")


EXECUTE = "steptwin.host.twin.embedded.execution.execute"


@pytest.mark.parametrize(
    ("words", "work", "name"),
    [
        ("run teaching-scara carry", EXECUTE, "report.json"),
        ("run teaching-scara carry", EXECUTE, "trace.vcd"),
        pytest.param("run teaching-scara carry", EXECUTE, "overview.png", marks=PLOT),
        ("workspace teaching-scara", "steptwin.host.robots.workspace.scan", "cloud.csv"),
    ],
)
def test_a_folder_with_the_name_of_a_file_is_told(
    words: str,
    work: str,
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(work, _nothing)
    (tmp_path / name).mkdir()
    told = f"--out {tmp_path}: {name} in it is a folder, where a file is to be written"
    with with_pictures():
        assert refusal(capsys, *words.split(), "--out", str(tmp_path)) == told
