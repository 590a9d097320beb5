"""A run's folder, written once."""

from pathlib import Path

import pytest

from controller.backend import Kernel
from host.cli.app import run
from host.run_folder import writing


@pytest.fixture(scope="session")
def carried(tmp_path_factory: pytest.TempPathFactory, fast_kernel: Kernel) -> Path:
    """What `run teaching-scara carry` leaves, without pictures: outputs switch, and axes turn around."""
    folder = tmp_path_factory.mktemp("carried")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writing, "find_spec", lambda _: None)
        assert run(["run", "warehouse-scara", "store", "--kernel", fast_kernel.name, "--out", str(folder)]) == 0
    return folder
