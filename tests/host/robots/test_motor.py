"""What a robot file may say of motors, links and supply, and the one line that refuses the rest."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.robots import brought_text, load_robot, parse_robot
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.motor import Dynamics, JointLink, JointMotor
from steptwin.host.robots.switches import JointSwitches
from tests.host.complaints import complaint_of
from tests.host.robots.coupled import coupled_text
from tests.messages import refusing

OWN: dict[str, Any] = {
    "resistance_ohm": 1.4, "inductance_mh": 3.0, "holding_torque_nm": 0.59, "rated_current_a": 2.0,
    "rotor_inertia_gcm2": 82.0, "detent_torque_nm": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "made",
    [
        lambda: JointMotor(**OWN),
        lambda: JointMotor("QSH5718-55", efficiency=1.0, belt_nm_rad=0.1),
        lambda: Dynamics(4.5),
        lambda: Dynamics(34.0, supply_ohm=0.0, supply_uf=0.0),
        lambda: Dynamics(24.0, supply_ohm=0.1, supply_uf=100.0),
        lambda: JointLink(0.0, inertia_kgm2=(1.0, 2.0, 3.0)),
    ],
)
def test_what_is_just_possible_is_taken(made: Any) -> None:
    made()


@pytest.mark.parametrize(
    ("made", "line"),
    [
        (lambda: Dynamics(0.0), "supply_v: 0 is not above 0"),
        (lambda: Dynamics(24.0, supply_ohm=-0.1), "supply_ohm: -0.1 ohm is negative"),
        (
            lambda: Dynamics(24.0, supply_ohm=0.1, supply_uf=99.0),
            "supply_uf: 99 uF is less than 100 uF: with supply_ohm something must hold what braking motors give back",
        ),
        (lambda: Dynamics(24.0, payload_kg=-1.0), "payload_kg: -1 kg is negative"),
        (lambda: JointMotor("QSH5718-55", efficiency=0.0), "efficiency: 0 is not above 0 and up to 1"),
        (lambda: JointMotor("QSH5718-55", efficiency=1.01), "efficiency: 1.01 is not above 0 and up to 1"),
        (lambda: JointMotor("QSH5718-55", brake_nm=-0.1), "brake_nm: -0.1 is negative"),
        (lambda: JointMotor("QSH5718-55", inductance_mh=3.0), "inductance_mh: model QSH5718-55 sets it already"),
        (
            lambda: JointLink(1.0, inertia_kgm2=(1.0, 2.0, 3.1)),
            "inertia_kgm2[2]: 3.1 is more than the sum of the other two, 3: no body has such inertias",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(made: Any, line: str) -> None:
    with pytest.raises(InputError) as refused:
        made()
    assert str(refused.value) == line


ELBOW = load_robot("teaching-scara").joint("th2")
"""From -150 to 150 degrees, its limit switches at -155 and 155, 4 turns of the motor for one of the joint."""


def stopped(stops: Mapping[str, Any], **changes: Any) -> Joint:
    """Return the elbow with end stops."""
    return replace(ELBOW, link=JointLink(0.25, **stops), **changes)


class TestEndStops:
    @pytest.mark.parametrize(
        ("stops", "changes"),
        [
            ({"stop_lower": -155.0}, {}),
            ({"stop_upper": 155.0}, {}),
            ({"stop_lower": -150.0}, {"switches": JointSwitches()}),
            ({"stop_upper": 150.0}, {"switches": JointSwitches()}),
            ({"stop_upper": 160.0}, {"switches": JointSwitches(home_from=160.0)}),
        ],
    )
    def test_lie_beyond_limits_and_switches(self, stops: dict[str, float], changes: dict[str, Any]) -> None:
        changes = {"homing": None, **changes}
        complaint_of(lambda: stopped(stops, **changes))
        beyond = {key: value * 1.0001 for key, value in stops.items()}
        stopped(beyond, **changes)

    def test_are_told_with_the_files_key(self) -> None:
        text = brought_text("teaching-scara")
        wrong = text.replace("[joints.th2.link]", "[joints.th2.link]\nstop_lower = -100.0\nstop_upper = 100.0")
        with pytest.raises(InputError) as refused:
            parse_robot(wrong, "mine.toml")
        assert refused.value.messages == (
            "mine.toml: joints.th2.link.stop_lower: -100 deg is not below switches.negative_limit, -155 deg",
            "mine.toml: joints.th2.link.stop_upper: 100 deg is not above switches.positive_limit, 155 deg",
        )

    def test_a_coupled_joint_has_none(self) -> None:
        text = coupled_text()
        parse_robot(text.replace("[joints.th1.link]", "[joints.th1.link]\nstop_upper = 170.0"), "belt.toml")
        wrong = text.replace("[joints.th2.link]", "[joints.th2.link]\nstop_upper = 170.0")
        complaint_of(lambda: parse_robot(wrong, "belt.toml"))


@pytest.mark.parametrize(("supply_v", "refused"), [(4.4, True), (4.5, False), (34.0, False), (34.1, True)])
def test_the_supply_is_in_the_range_of_the_drivers(supply_v: float, refused: bool) -> None:
    robot = load_robot("lab-scara")
    assert robot.dynamics is not None
    dynamics = replace(robot.dynamics, supply_v=supply_v)
    if not refused:
        assert replace(robot, dynamics=dynamics).dynamics == dynamics
        return
    with refusing(InputError):
        replace(robot, dynamics=dynamics)
