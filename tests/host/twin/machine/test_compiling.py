"""What numba compiles for the first time is told once, and what it loads is not."""

import pytest

from steptwin.host.twin.machine.kernels import telling_of_compiling

numba = pytest.importorskip("numba", reason="the extra `fast` is not installed")


def test_it_is_told_once_and_only_if_something_is_compiled() -> None:
    told: list[str] = []
    with telling_of_compiling(lambda: told.append("compiles")):
        pass
    assert told == []

    def twice(value: int) -> int:
        return 2 * value

    with telling_of_compiling(lambda: told.append("compiles")):
        for _ in range(2):
            assert numba.njit(["i8(i8)"])(twice)(3) == 6
    assert told == ["compiles"]
    assert numba.njit(["i8(i8)"])(twice)(4) == 8
    assert told == ["compiles"]
