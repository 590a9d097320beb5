"""The kernel places the benchmark's motions on the emulated core as on this computer, to the count."""

import shutil

import numpy as np
import pytest

from steptwin.bench.step_methods.kernel import place_once
from steptwin.bench.step_methods.motions import PlannedMotion, all_motions
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import COMPILER

pytest.importorskip("unicorn", reason="the extra `m3` (unicorn) is not installed")
if shutil.which(COMPILER) is None:
    pytest.skip(f"{COMPILER} is not installed", allow_module_level=True)

from steptwin.features.kernel_c.core_kernel import cortex_m3_kernel


@pytest.fixture(scope="module")
def motions() -> dict[str, PlannedMotion]:
    """Return the motions of the benchmark by name."""
    return {motion.name: motion for motion in all_motions()}


@pytest.mark.parametrize(
    "name", [pytest.param("warehouse-scara pull-line", marks=pytest.mark.slow), "teaching-scara carry"]
)
def test_motions_of_the_benchmark(name: str, motions: dict[str, PlannedMotion], fast_kernel: Kernel) -> None:
    on_core, expected = (place_once(kernel, motions[name]).axes for kernel in (cortex_m3_kernel(), fast_kernel))
    for own, other in zip(on_core, expected, strict=True):
        for field in ("rise_counts", "fall_counts", "dir_counts", "dir_levels"):
            assert np.array_equal(getattr(own, field), getattr(other, field)), field
