"""The motors that robot files name, and their drives."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.motors.rotors.motor import CATALOGUE
from steptwin.features.motors.turning.drives import drive_of
from steptwin.host.robots import load_robot
from steptwin.host.robots.motor import MOTORS, JointLink
from steptwin.protocol.drivers import bare_chip
from tests.end_to_end.pages import read_page


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


def test_end_stops_are_angles_of_the_rotor() -> None:
    elbow = load_robot("teaching-scara").joint("th2")
    stopped = replace(elbow, link=JointLink(0.25, stop_lower=-180.0, stop_upper=155.01))
    drive = drive_of(stopped, bare_chip(330).chip)
    turns = elbow.transmission.ratio
    assert drive.lower_rad == pytest.approx(-np.pi * turns)
    assert drive.upper_rad == pytest.approx(np.deg2rad(155.01) * turns)
