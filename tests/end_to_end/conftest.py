"""Fixtures for tests of whole runs."""

from collections.abc import Callable
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from docs.generate.runs import Runs
from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT
from tests.shared_folders import made_once

EXAMPLE_INPUTS = {"teaching-scara": ["--input", "part_ready=on@1.5"]}
"""Options of examples that wait for inputs."""


@pytest.fixture(scope="session")
def runs(fast_kernel: Kernel) -> Runs:
    """Return all jobs with default options; each is run once, when a test first asks for it."""
    return Runs(fast_kernel)


@pytest.fixture(scope="session")
def example_run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return what gives the folder of a robot's example in docs/programs, with what the run printed in printed.txt."""
    made: dict[str, Path] = {}

    def write(robot: str, folder: Path) -> None:
        words = ["run", robot, f"docs/programs/{robot}.toml", *EXAMPLE_INPUTS.get(robot, [])]
        with chdir(ROOT), redirect_stdout(StringIO()) as printed:
            assert run([*words, "--out", str(folder / "run")]) == 0
        (folder / "printed.txt").write_text(printed.getvalue(), encoding="utf-8")

    def folder_of(robot: str) -> Path:
        if robot not in made:
            made[robot] = made_once(tmp_path_factory, f"example-{robot}", lambda folder: write(robot, folder))
        return made[robot]

    return folder_of
