"""Numbers from outside have one notation: ASCII digits, a point, an exponent."""

import pytest

from steptwin.host.common.numbers import LARGEST, decimal, finite_number, whole
from tests.host.complaints import complaint_of
from tests.messages import refusing

FOREIGN = ["1_0", "１", "1٫5", "١", "1\u2009", "1\u00a0", "\u22121"]


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("+1.5e1", 15.0), (" -.5 ", -0.5), ("5.", 5.0), ("1e9", LARGEST), ("-1E9", -LARGEST)],
)
def test_a_number_is_read(text: str, value: float) -> None:
    assert finite_number(text) == decimal(text) == value


@pytest.mark.parametrize("text", [*FOREIGN, "", "one", "1,5", "0x10", "1e", "1 0"])
def test_another_notation_is_refused(text: str) -> None:
    complaint_of(lambda: finite_number(text))


@pytest.mark.parametrize("text", ["1000000000.1", "-1000000001", "inf", "-Infinity", "nan", "1e400"])
def test_a_number_that_no_machine_has_is_refused(text: str) -> None:
    complaint_of(lambda: finite_number(text))


@pytest.mark.parametrize(("text", "value"), [("16", 16), ("0x10", 16), ("-0b11", -3)])
def test_a_whole_number_is_read(text: str, value: int) -> None:
    assert whole(text, 0) == value


@pytest.mark.parametrize("text", [*FOREIGN, "1.0", "0x1_0"])
def test_what_is_no_whole_number_is_refused(text: str) -> None:
    with refusing(ValueError):
        whole(text, 0)
