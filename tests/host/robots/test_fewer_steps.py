"""Speeds that the driver cannot follow: the robot file's refusal says which speed and which drive would do."""

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.robots import brought_text, load_robot
from steptwin.host.robots.joint import with_fewer_steps
from steptwin.host.robots.reader import parse_robot
from tests.host.complaints import complaint_of

TEXT = brought_text("teaching-scara")
ROBOT = load_robot("teaching-scara")
BEGINNING = {name: TEXT.index(f"[joints.{name}]") for name in ROBOT.joint_names}


def changed(name: str, **settings: float | str) -> str:
    """Return the robot's file with other settings of a joint."""
    head, joint = TEXT[: BEGINNING[name]], TEXT[BEGINNING[name] :]
    for key, value in settings.items():
        joint, count = re.subn(rf"^{key} = [\d.]+", f"{key} = {value}", joint, count=1, flags=re.MULTILINE)
        assert count == 1
    return head + joint


def suggested(text: str) -> tuple[float, dict[str, float]]:
    """Return the largest speed and the drive that the refusal of a robot's file names."""
    told = complaint_of(lambda: parse_robot(text, "mine.toml"))
    speed, drive = re.findall(r"; speed_max = (\S+) or (.*) would do$", told)[0]
    return float(speed), {key: float(value) for key, value in re.findall(r"(\w+) = (\S+)", drive)}


@pytest.mark.parametrize(
    ("name", "speed_max", "drive"),
    [
        ("d3", 46.9, {"microsteps": 2}),
        ("d3", 187.5, {"microsteps": 2}),
        ("d3", 187.6, {"microsteps": 1}),
        ("d3", 375.1, {"microsteps": 1, "travel_per_turn": 5.00134}),
        ("th1", 421.9, {"microsteps": 8}),
        ("th1", 10_000, {"microsteps": 1, "ratio": 2.7}),
    ],
)
def test_the_speed_and_the_drive_that_would_do(name: str, speed_max: float, drive: dict[str, float]) -> None:
    fastest, found = suggested(changed(name, speed_max=speed_max))
    assert found == drive
    parse_robot(changed(name, speed_max=fastest), "mine.toml")
    assert suggested(changed(name, speed_max=fastest * 1.0001))[0] == fastest
    drive_texts = {key: f"{value:g}" for key, value in found.items()}
    parse_robot(changed(name, speed_max=speed_max, **drive_texts), "mine.toml")


def test_a_drive_in_full_steps_has_another_lead_only() -> None:
    fastest, drive = suggested(changed("d3", microsteps=1, speed_max=750.0))
    assert (fastest, drive) == (375.0, {"travel_per_turn": 10.0})


@pytest.mark.slow
@given(st.floats(0.1, 37.0))
def test_the_largest_speed_passes_for_any_ratio(ratio: float) -> None:
    """Most steps per degree are inexact. Above a ratio of 37.5 the driver could not follow the homing's speed."""
    fastest, _ = suggested(changed("th1", ratio=ratio, speed_max=1e9))
    parse_robot(changed("th1", ratio=ratio, speed_max=fastest), "mine.toml")
    suggested(changed("th1", ratio=ratio, speed_max=fastest * (1 + 2e-5)))


@given(st.sampled_from(ROBOT.joints), st.floats(1e-6, 1.0, exclude_max=True))
def test_the_drive_makes_at_most_this_part_of_the_steps(joint: object, part: float) -> None:
    found = next(known for known in ROBOT.joints if known is joint)
    drive, _ = with_fewer_steps(found, part, (1, 2, 8, 16))
    slower = replace(found, transmission=drive)
    assert slower.step_rate_max_hz <= part * found.step_rate_max_hz * (1 + 1e-11)


def test_the_highest_rate_that_the_pulses_allow() -> None:
    """33 us high and 33.67 us low are 14 999.2 Hz at most."""
    rate = r"step_rate_max_hz = \S+"
    assert len(re.findall(rate, TEXT)) == 1
    slow = re.sub(r"stepspace_ns = \S+", "stepspace_ns = 33_670", TEXT)
    told = complaint_of(lambda: parse_robot(re.sub(rate, "step_rate_max_hz = 15_000", slow), "mine.toml"))
    limit = told.split(" is more than the ", 1)[1].split(" ", 1)[0]
    assert parse_robot(re.sub(rate, f"step_rate_max_hz = {limit}", slow), "mine.toml").board.step_rate_max_hz > 14_999


def test_homing_is_no_faster_than_the_joint() -> None:
    told = complaint_of(lambda: parse_robot(changed("th1", search_speed="180.1"), "mine.toml"))
    assert told.endswith("joints.th1.homing.search_speed: 180.1 is above speed_max, 180")
    parse_robot(changed("th1", search_speed="180"), "mine.toml")
