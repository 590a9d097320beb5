"""The calibration robot's paper: ICMEMTC 2016."""

from dataclasses import replace
from functools import cache, partial
from math import cos, radians, sqrt

import numpy as np
import pytest

from steptwin.features.calibration.identification import Identification, identify_errors, rms_mm
from steptwin.features.calibration.measurements import simulate_measurements
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.link_errors import QUANTITIES, LinkErrors
from tests.features.papers.numbers import Arm, Misprint, Number, check_misprint, check_number, numbers_of_page

ARM = Arm("calibration-scara")
AT = (30.0, 45.0, 50.0, 20.0)
WRONG = {"link2": LinkErrors(a_mm=0.4, theta_deg=0.1), "link1": LinkErrors(alpha_deg=0.1)}


def tip_mm(joints: FloatArray, convention: Convention = Convention.STANDARD) -> FloatArray:
    """Return the tip by table 1, read in a convention."""
    table = replace(ARM.kinematics.dh, convention=convention)
    return table.transforms(ARM.kinematics.dh_variables(joints))[:, :3, 3]


def tip(joints: tuple[float, ...], convention: Convention = Convention.STANDARD) -> FloatArray:
    return np.asarray(tip_mm(np.array([joints]), convention)[0])


def column_mm(th2_deg: float, convention: Convention) -> float:
    return float(np.hypot(*tip((0.0, th2_deg, 0.0, 0.0), convention)[:2]))


def by_cosines_mm(th2_deg: float) -> float:
    return sqrt(250.0**2 + 350.0**2 + 2 * 250.0 * 350.0 * cos(radians(th2_deg)))


@cache
def random_joints() -> FloatArray:
    lower, upper = ([getattr(joint, end) for joint in ARM.robot.joints] for end in ("lower", "upper"))
    return np.random.default_rng(1).uniform(lower, upper, (1000, len(lower)))


def apart_mm(others: FloatArray) -> float:
    return float(np.linalg.norm(others - tip_mm(random_joints()), axis=1).max())


def drawn_mm() -> FloatArray:
    return ARM.kinematics.links(random_joints())[-1].points_mm[:, -1]


@cache
def identified() -> Identification:
    measured = simulate_measurements(replace(ARM.robot, dh_errors=WRONG), 50, 0.02, seed=1)
    return identify_errors(Chain.of(ARM.robot), measured)


def worst_sigma() -> float:
    true = {f"{link}.{name}": getattr(errors, name) for link, errors in WRONG.items() for name in QUANTITIES}
    off = (abs(each.found - true.get(each.name, 0.0)) / each.deviation
           for each in identified().parameters if each.deviation)  # fmt: skip
    return float(max(off))


NUMBERS = [
    Number("L1", 250.0, lambda: ARM.mm("L1_mm")),
    Number("L2", 350.0, lambda: ARM.mm("L2_mm")),
    Number("d1", 300.0, lambda: ARM.mm("d1_mm")),
    Number("alpha of row 3", 180.0, lambda: ARM.kinematics.dh.rows[2].alpha_deg),
    Number("links", 4, lambda: len(ARM.kinematics.dh.rows)),
    Number("x by the matrices", 307.09301673199195, lambda: tip(AT)[0], 1e-9),
    Number("y by the matrices", 463.0740392011739, lambda: tip(AT)[1], 1e-9),
    Number("z by the matrices", 250.0, lambda: tip(AT)[2], 1e-9),
    Number("psi", 55.0, lambda: ARM.pose(AT)[3], 1e-9),
    Number("a_z: the tool points down", -1.0, lambda: ARM.frame(AT)[2, 2], 1e-9),
    Number("drawn and computed tip apart", 0.0, lambda: apart_mm(drawn_mm()), 1e-9),
    Number("closed form and matrices apart", 0.0,
           lambda: apart_mm(ARM.kinematics.forward(random_joints())[:, :3]), 1e-9),
    Number("parameters of the model", 16, lambda: len(identified().parameters)),
    Number("parameters that measured positions tell apart", 8, lambda: identified().rank),
    Number("tool off the nominal model, rms", 0.911542506234, lambda: rms_mm(identified().before_mm)),
    Number("tool off the identified model, rms", 0.0306236245203, lambda: rms_mm(identified().after_mm)),
    Number("an identified parameter off the true one, most", 1.73886783956, worst_sigma, 1e-4),
]  # fmt: skip

PLACE = "parameter text and table 1"
MISPRINTS = [
    Misprint(PLACE, tip(AT, Convention.MODIFIED)[0], tip(AT)[0],
             lambda: 250.0 * cos(radians(30)) + 350.0 * cos(radians(75))),
    *(Misprint(PLACE, column_mm(th2, Convention.MODIFIED), column_mm(th2, Convention.STANDARD),
               partial(by_cosines_mm, th2)) for th2 in (45.0, 145.0)),
]  # fmt: skip


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.item)
def test_number(number: Number) -> None:
    check_number(ARM.name, number)


@pytest.mark.parametrize("misprint", MISPRINTS)
def test_misprint(misprint: Misprint) -> None:
    check_misprint(ARM.name, misprint)


def test_transfer_coefficients() -> None:
    """By differences of the plane arm."""
    chain = Chain.of(ARM.robot)
    moves = dict(zip(chain.parameters, chain.sensitivities(np.array([AT]))[0].T.tolist(), strict=True))
    a, b = radians(30), radians(75)
    assert moves["link1.a_mm"][:3] == pytest.approx([cos(a), np.sin(a), 0.0], abs=1e-6)
    assert moves["link2.a_mm"][:3] == pytest.approx([cos(b), np.sin(b), 0.0], abs=1e-6)
    turned = [radians(1) * move for move in (-350 * np.sin(b), 350 * cos(b), 0.0)]
    assert moves["link2.theta_deg"][:3] == pytest.approx(turned, abs=1e-6)
    assert moves["link1.d_mm"] == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def test_every_number_of_the_page_is_here() -> None:
    assert numbers_of_page(ARM.name) <= {number.item for number in NUMBERS}
