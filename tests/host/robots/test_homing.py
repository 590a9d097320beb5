"""Switches and homing in a robot file: errors, and the settings that an axis gets."""

from dataclasses import replace

import pytest

from steptwin.host.operate.homing import homing_settings
from steptwin.host.robots import brought_text, load_robot, parse_robot, robot_names
from steptwin.host.robots.switches import JointHoming, JointSwitches
from steptwin.protocol import od
from tests.host.complaints import complaint_of

TEXT = brought_text("warehouse-scara")
SX = load_robot("warehouse-scara").joint("sx")
ALL = JointSwitches(-5.0, 2005.0, -2.0, 3.0)
SEEN_AT = {
    17: (-5.0, 1),
    18: (2005.0, -1),
    19: (-2.0, -1),
    20: (-2.0, 0),
    21: (3.0, 1),
    22: (3.0, 0),
    23: (-2.0, -1),
    24: (-2.0, 0),
    25: (3.0, 0),
    26: (3.0, 1),
    27: (3.0, 1),
    28: (3.0, 0),
    29: (-2.0, 0),
    30: (-2.0, -1),
}
"""By the figures of CiA 402-2: position of the home edge, and steps beyond it at which the switch opens."""


MISSING_LIMITS = {"ar4-mk3": 1, "corexy-gantry": 1, "parol6": 2, "thor": 2, "turntable": 1}
"""The papers' robots have switches at both ends; most machines one for each joint, the others home switches alone."""


@pytest.mark.parametrize("name", robot_names())
def test_every_joint_of_every_robot_can_be_homed(name: str) -> None:
    for joint in load_robot(name).joints:
        limits = [joint.switches.negative_limit, joint.switches.positive_limit]
        assert limits.count(None) == MISSING_LIMITS.get(name, 0)
        assert homing_settings(joint) is not None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "negative_limit = -5.0",
            "negative_limit = 0",
            "joints.sx.switches.negative_limit: 0 mm is not below lower",
        ),
        ("negative_limit = -5.0", "negative_limit = []", "joints.sx.switches.negative_limit: [] is not a number"),
        ("positive_limit = 2005.0", "positive_limit = 2000", "joints.sx.switches.positive_limit: 2000 mm is not above"),
        (
            "negative_limit = -5.0",
            "negative_limits = 0",
            "joints.sx.switches.negative_limits: key 'negative_limits'",
        ),
        ("negative_limit = -5.0", "", "joints.sx.homing.method: 17 needs switches.negative_limit"),
        ("method = 17", "method = 18", None),
        ("method = 17", "method = 33", "joints.sx.homing.method: 33 is not one of 17 to 30, 35, 37"),
        ("method = 17", "method = 19", "joints.sx.homing.method: 19 needs switches.home_from"),
        ("method = 17", "method = 37", None),
        ("method = 17", "", "joints.sx.homing.method: is missing"),
        ("search_speed = 50.0", "search_speed = 0", "joints.sx.homing.search_speed: 0 is not above 0"),
        ("search_speed = 50.0", "search_speed = 301", "joints.sx.homing.search_speed: 301 is above speed_max, 300"),
        ("search_speed = 50.0", "search_speed = 4", "joints.sx.homing.zero_speed: 5 is above search_speed, 4"),
        ("zero_speed = 5.0", "zero_speed = -1", "joints.sx.homing.zero_speed: -1 is not above 0"),
        ("zero_speed = 5.0", "", "joints.sx.homing.zero_speed: is missing"),
        ("acceleration = 500.0", "acceleration = 501", "joints.sx.homing.acceleration: 501 is above acceleration_max"),
        ("acceleration = 500.0", "colour = 1", "joints.sx.homing.colour: key 'colour' is unknown: there are method"),
        ("home_from = 182.0", "", "joints.th3.homing.method: 24 needs switches.home_from"),
        ("home_to = 186.0", "", "joints.th3.homing.method: 24 needs switches.home_to"),
        ("home_to = 186.0", "home_to = 182", "joints.th3.switches.home_to: 182 is not above home_from, 182"),
        ("home_to = 186.0", "home_to = -190", "joints.th3.switches.home_to: -190 is not above home_from, 182"),
        ("method = 24", "method = 20", "joints.th3.homing.method: 20 is for a home switch without home_to; 23 to 30"),
        ("method = 24", "method = 21", "joints.th3.homing.method: 21 is for a home switch without home_from"),
        ("positive_limit = 190.0", "", "joints.th3.homing.method: 24 needs switches.positive_limit"),
    ],
)
def test_an_error_names_its_key(old: str, new: str, words: str | None) -> None:
    assert old in TEXT
    text = TEXT.replace(old, new, 1)
    if words is None:
        parse_robot(text, "mine.toml")
        return
    told = complaint_of(lambda: parse_robot(text, "mine.toml"))
    assert told.startswith(f"mine.toml: {words}")


def test_switches_and_homing_may_be_left_out() -> None:
    text = TEXT
    for joint in ("sx", "sz", "L1", "th1", "th2", "th3"):
        begin = text.index(f"[joints.{joint}.switches]")
        text = text[:begin] + text[text.index("\n[", text.index(f"[joints.{joint}.homing]")) + 1 :]
    robot = parse_robot(text, "mine.toml")
    assert all(joint.switches == JointSwitches() for joint in robot.joints)
    assert [homing_settings(joint) for joint in robot.joints] == [None] * 6


class TestSettings:
    """The joint sx has 8 microsteps, 40 steps per mm and 81 920 units per mm."""

    def test_in_the_objects_units(self) -> None:
        joint = replace(SX, switches=ALL, homing=JointHoming(24, 100.0, 5.0, 400.0))
        settings = homing_settings(joint)
        assert settings is not None
        assert settings.objects()[:5] == [
            (od.HOMING_METHOD, 24),
            (od.HOMING_SEARCH_SPEED, 8_192_000),
            (od.HOMING_ZERO_SPEED, 409_600),
            (od.HOMING_ACCELERATION, 32_768_000),
            (od.HOME_OFFSET, -163_840),
        ]

    @pytest.mark.parametrize("method", sorted(SEEN_AT))
    def test_the_offset_is_the_step_at_which_the_edge_is_seen(self, method: int) -> None:
        switches = ALL
        if method in (19, 20, 21, 22):
            switches = replace(ALL, **{"home_to" if method in (19, 20) else "home_from": None})
        settings = homing_settings(replace(SX, switches=switches, homing=JointHoming(method, 100.0, 5.0, 400.0)))
        assert settings is not None
        edge, beyond_steps = SEEN_AT[method]
        assert settings.offset_units == round(edge * 81_920) + beyond_steps * 2_048

    def test_method_37_needs_no_switch_and_has_no_offset(self) -> None:
        settings = homing_settings(replace(SX, switches=JointSwitches(), homing=JointHoming(37, 100.0, 5.0, 400.0)))
        assert settings is not None
        assert settings.offset_units == 0
