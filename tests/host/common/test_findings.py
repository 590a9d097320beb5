"""Findings: every error of an input, in order."""

import pytest

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings, check_all
from tests.messages import refusing


def test_collects_one_error_of_each_block_and_goes_on() -> None:
    findings = Findings()
    for number in (1, 2, 3):
        with findings.collecting(f"step {number}: "):
            if number != 2:
                raise InputError(f"{number} is odd")
    assert findings.messages == ["step 1: 1 is odd", "step 3: 3 is odd"]
    with refusing(InputError):
        findings.raise_first()


def test_an_input_without_errors_raises_nothing() -> None:
    findings = Findings()
    with findings.collecting():
        pass
    findings.raise_first()
    assert not findings.messages


def test_other_errors_are_not_findings() -> None:
    with pytest.raises(ZeroDivisionError), Findings().collecting():
        _ = 1 / 0


def test_an_error_with_several_messages_is_several_findings() -> None:
    findings = Findings()
    with findings.collecting("file: "), prefixed("table."):
        raise InputError("a: is 1", "b: is 2")
    assert findings.messages == ["file: table.a: is 1", "file: table.b: is 2"]
    with refusing(InputError) as caught:
        findings.raise_first()
    assert caught.value.messages == ("file: table.a: is 1", "file: table.b: is 2")


def test_check_all_makes_every_check() -> None:
    def fail(message: str) -> None:
        raise InputError(message)

    with pytest.raises(InputError) as caught:
        check_all(lambda: fail("first"), lambda: None, lambda: fail("third"))
    assert caught.value.messages == ("first", "third")
    check_all(lambda: None)
