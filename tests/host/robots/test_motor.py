"""What a robot file may say of motors, links and supply, and the one line that refuses the rest."""

from typing import Any

import pytest

from steptwin.emulator.motor import CATALOGUE
from steptwin.host.common.errors import InputError
from steptwin.host.robots.motor import MOTORS, Dynamics, JointLink, JointMotor
from tests.end_to_end.pages import read_page

OWN: dict[str, Any] = {
    "resistance_ohm": 1.4, "inductance_mh": 3.0, "holding_torque_nm": 0.59, "rated_current_a": 2.0,
    "rotor_inertia_gcm2": 82.0, "detent_torque_nm": 0.0,
}  # fmt: skip


def test_the_motors_that_files_may_name_are_those_of_the_catalogue() -> None:
    assert tuple(CATALOGUE) == MOTORS


def test_the_page_lists_the_catalogue_with_its_figures() -> None:
    page = read_page("docs/motors.md")
    for motor in CATALOGUE.values():
        figures = (
            motor.resistance_ohm, motor.inductance_mh, motor.holding_torque_nm, motor.rated_current_a,
            motor.rotor_inertia_gcm2, motor.detent_torque_nm,
        )  # fmt: skip
        assert f"| {motor.name} | {' | '.join(f'{figure:g}' for figure in figures)} | {motor.source} |" in page


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
        (lambda: Dynamics(4.4), "supply_v: 4.4 V is outside 4.5..34 V, the TB6560AHQ's operating range"),
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
