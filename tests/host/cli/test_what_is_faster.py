"""A long run without numba says once which extra makes it faster; a short one, or one with numba, says nothing."""

import pytest

from steptwin.host.cli.run import virtual_run
from steptwin.host.common.extras import installing


@pytest.mark.parametrize(
    ("wall_s", "numba", "said"),
    [
        (3.0, False, ""),
        (3.1, False, f"numba makes long runs about twice as fast ({installing('fast')})\n"),
        (60.0, True, ""),
    ],
)
def test_a_long_run_names_the_extra(
    wall_s: float, numba: bool, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(virtual_run, "find_spec", lambda _: object() if numba else None)
    virtual_run.print_missing_extra(wall_s)
    assert capsys.readouterr() == ("", said)
