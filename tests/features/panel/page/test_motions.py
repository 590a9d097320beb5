"""The motions of the Run tab: why one is refused, in the words of the page."""

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.features.panel.page.motions import UploadedMotion, plan_job, plan_upload
from steptwin.features.panel.service.messages import AS_SLOW_AS_NEEDED, operator_message
from steptwin.host.common.errors import InputError
from steptwin.host.planning.plan import Plan
from steptwin.host.robots import load_robot
from tests.messages import refused_with

LAB = load_robot("lab-scara")
FAST = b"t,d1,th2,th3,th4\n0,100,0,0,0\n0.1,100,90,0,0\n"
PROGRAM = b"""
robot = "lab-scara"
[[step]]
go = { th2 = 90.0 }
duration_s = 0.1
"""


def refusal(name: str, content: bytes, stretch: float | None = 1.0) -> str:
    with pytest.raises(InputError) as refused:
        plan_upload(UploadedMotion(LAB, name, content, stretch))
    return refused_with(operator_message(refused.value))


def test_a_file_that_is_too_fast_offers_what_the_page_offers() -> None:
    for stretch in (1.0, 2.0):
        text = refusal("fast.csv", FAST, stretch)
        assert text.startswith("th2: 60.0 kHz of steps at " if stretch == 1.0 else "th2: 30.0 kHz of steps at ")
        assert f'times slower passes: choose the speed "{AS_SLOW_AS_NEEDED}"' in text
        assert "stretch" not in text
    assert isinstance(plan_upload(UploadedMotion(LAB, "fast.csv", FAST, None))[0], Plan)


def test_a_step_of_a_program_that_is_too_fast_is_named() -> None:
    text = refusal("fast.toml", PROGRAM)
    assert text.startswith("step 1 (go to th2 90): th2: a speed of ")
    assert "; duration_s = 1.039 passes; " in text
    assert text.endswith(f'times slower passes: choose the speed "{AS_SLOW_AS_NEEDED}"')


def test_a_wrong_file_is_named_as_its_user_knows_it() -> None:
    refusal("mine.csv", b"t,d1\n")
    refusal("mine.txt", b"")


def test_an_option_of_a_job_is_named_as_in_its_form() -> None:
    with pytest.raises(InputError) as refused:
        plan_job(load_robot("warehouse-scara"), "pull-line", {"duration_s": "1", "ramp_s": "2"}, 1.0)
    assert (
        operator_message(refused.value)
        == '"time to speed up": 2 s is not above 0 and at most 0.5 s, half of "duration"'
    )
    assert str(refused.value).startswith("ramp_s: ")
