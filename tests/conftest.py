"""Fixtures that every test may use."""

from importlib.util import find_spec

import pytest
from hypothesis import settings

from controller.backend import KERNELS, Kernel

# No timing is asserted in a test, not even by the framework; and every run draws the same examples, so that a change
# is judged by what it changed. `pytest --hypothesis-profile=explore` draws new ones.
settings.register_profile("steptwin", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("steptwin")


@pytest.fixture(params=["python", "numba"])
def kernel(request: pytest.FixtureRequest) -> Kernel:
    """The kernel in both of its forms; the compiled one only where the extra `fast` is installed."""
    if request.param == "numba" and not find_spec("numba"):
        pytest.skip("the extra `fast` (numba) is not installed")
    return KERNELS[request.param]()


@pytest.fixture(scope="session")
def fast_kernel() -> Kernel:
    """The fastest kernel there is, for tests in which it does not matter which one runs."""
    return KERNELS["numba" if find_spec("numba") else "python"]()
