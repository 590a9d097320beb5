"""Fixtures that every test may use."""

from importlib.util import find_spec

import pytest
from hypothesis import settings

from controller.backend import KERNELS, Kernel

settings.register_profile("steptwin", deadline=None)  # no timing is asserted in a test, not even by the framework
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
