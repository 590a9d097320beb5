"""How long the motors will take: told once, and only if it is long."""

import pytest

from steptwin.features.motors import report as motor_report
from steptwin.host.common.extras import installing


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands; its only element is the time."""
    now_s = [100.0]
    monkeypatch.setattr("steptwin.features.motors.report.time.monotonic", lambda: now_s[0])
    return now_s


@pytest.mark.parametrize(
    ("numba", "remedy"),
    [(True, ""), (False, f"; numba makes it some hundred times faster ({installing('fast')})")],
)
def test_a_long_work_is_told_from_its_pace_after_the_first_report(
    numba: bool, remedy: str, clock: list[float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Until the first report functions may have been compiled: 99 s there do not count."""
    monkeypatch.setattr(motor_report, "find_spec", lambda _: object() if numba else None)
    reported: list[float] = []
    report = motor_report.telling_time(reported.append, "motors")
    for at_s, fraction in ((199.0, 0.01), (199.5, 0.02), (201.0, 0.05), (203.0, 0.09)):
        clock[0] = at_s
        report(fraction)
    assert reported == [0.01, 0.02, 0.05, 0.09]
    assert capsys.readouterr().err == f"motors: about 50 s{remedy}\n"


def test_a_short_work_says_nothing(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    report = motor_report.telling_time(lambda _: None, "motors")
    for at_s, fraction in ((100.0, 0.1), (101.5, 0.4), (104.0, 1.0)):
        clock[0] = at_s
        report(fraction)
    assert capsys.readouterr().err == ""
