"""A run whose folder many tests of this room read."""

from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from tests.run_pictures import without_pictures
from tests.shared_folders import made_once


@pytest.fixture(scope="session")
def store_run(tmp_path_factory: pytest.TempPathFactory, fast_kernel: Kernel) -> Path:
    """Return the folder of a quick `run warehouse-scara store`: 9 s, in which outputs switch and the shelf is told."""
    words = ["run", "warehouse-scara", "store", "-o", "pull_s=1", "-o", "approach_mm=5", "-o", "law=fastest"]

    def write(folder: Path) -> None:
        with without_pictures():
            assert run([*words, "--kernel", fast_kernel.name, "--out", str(folder)]) == 0

    return made_once(tmp_path_factory, "store-quick", write)
