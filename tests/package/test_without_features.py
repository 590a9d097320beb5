"""Each feature can be deleted, with its registration and tests: what is left runs, checks and helps.

`python -m tests.without NAME tests/emulator ...` runs the tests that are left, which takes minutes for each feature.
"""

from pathlib import Path

import pytest

from steptwin.host.common.features import features
from tests.without import copy_without, gone_with, run_in

PROGRAM = 'robot = "ar4-mk3"\n[[step]]\npause = 0.1\n'
STILL = "t,J1,J2,J3,J4,J5,J6\n0,0,0,0,0,45,0\n0.2,0.1,0,0,0,45,0\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", features())
def test_what_is_left_works(name: str, tmp_path: Path) -> None:
    copy = copy_without(name, tmp_path)
    (copy / "still.csv").write_text(STILL, encoding="utf-8")
    (copy / "still.toml").write_text(PROGRAM, encoding="utf-8")
    for words in (
        ("-m", "steptwin", "run", "ar4-mk3", "still.csv", "--kernel", "python"),
        ("-m", "steptwin", "check", "still.toml"),
    ):
        done = run_in(copy, *words)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    shown = run_in(copy, "-m", "steptwin", "--help")
    assert shown.stderr == ""
    for gone in gone_with(name):
        assert not any(f"│ {row.name} " in shown.stdout for row in features()[gone].commands)
