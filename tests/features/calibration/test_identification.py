"""Calibration by simulated measurements: what is found is what was put in, as surely as the bounds say."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from steptwin.features.calibration.identification import Identification, identify_errors, rms_mm
from steptwin.features.calibration.measurements import Measurements, simulate_measurements
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.robot import Robot
from tests.features.papers.mechanisms import CALIBRATION, SCARAS, Mechanism, each_scara
from tests.host.complaints import complaint_of

NOISE_MM = 0.02
POSES = 50
SEEDS = 100

TOLD = {
    "link1.a_mm": 0.41,
    "link1.alpha_deg": 0.08,
    "link1.d_mm": -0.35,
    "link1.theta_deg": -0.25,
    "link2.a_mm": -0.32,
    "link2.alpha_deg": -0.06,
    "link2.theta_deg": 0.15,
    "link4.a_mm": 0.22,
}
"""Errors of the parameters of the calibration robot that measured positions can tell apart."""


def with_errors(robot: Robot, errors: FloatArray) -> Robot:
    return replace(robot, dh_errors=Chain.of(robot).with_errors(errors).link_errors)


def errors_of(robot: Robot, named: dict[str, float]) -> FloatArray:
    return np.array([named.get(name, 0.0) for name in Chain.of(robot).parameters])


def calibrated(robot: Robot, errors: FloatArray, seed: int, noise_mm: float = NOISE_MM) -> Identification:
    """Return what a calibration finds that begins with the robot's own file."""
    return identify_errors(Chain.of(robot), simulate_measurements(with_errors(robot, errors), POSES, noise_mm, seed))


@dataclass(frozen=True, eq=False)
class Trials:
    """Calibrations of one machine with many seeds: found and true errors and deviations, (seeds, parameters)."""

    results: list[Identification]
    found: FloatArray
    true: FloatArray
    deviations: FloatArray

    @property
    def missed(self) -> FloatArray:
        """Distance from the truth in standard deviations."""
        return np.abs(self.found - self.true) / self.deviations


@pytest.fixture(scope="module")
def trials() -> Trials:
    errors = errors_of(CALIBRATION.robot, TOLD)
    results = [calibrated(CALIBRATION.robot, errors, seed) for seed in range(SEEDS)]
    told = [[p for p in result.parameters if p.identified] for result in results]
    assert {tuple(p.name for p in each) for each in told} == {tuple(TOLD)}
    return Trials(
        results,
        np.array([[p.found for p in each] for each in told]),
        np.array([*TOLD.values()]),
        np.array([[p.deviation or 0.0 for p in each] for each in told]),
    )


class TestOneHundredSeeds:
    @pytest.mark.slow
    def test_each_parameter_is_within_3_sigma_in_99(self, trials: Trials) -> None:
        within = (trials.missed <= 3.0).sum(axis=0)
        assert dict(zip(TOLD, (within >= 99).tolist(), strict=True)) == dict.fromkeys(TOLD, True)

    @pytest.mark.slow
    def test_the_bounds_are_no_wider_than_they_must_be(self, trials: Trials) -> None:
        """Of normal errors 68 % are within one sigma and 95 % within two; and sigma is how the results scatter."""
        assert (trials.missed <= 1.0).mean() == pytest.approx(0.683, abs=0.05)
        assert (trials.missed <= 2.0).mean() == pytest.approx(0.954, abs=0.02)
        scatter = np.std(trials.found - trials.true, axis=0)
        assert trials.deviations.mean(axis=0) == pytest.approx(scatter, rel=0.25)

    @pytest.mark.slow
    def test_nothing_is_found_on_one_side(self, trials: Trials) -> None:
        mean = np.mean((trials.found - trials.true) / trials.deviations, axis=0)
        assert np.abs(mean).max() < 3.5 / np.sqrt(SEEDS)

    def test_the_residuals_are_the_noise(self, trials: Trials) -> None:
        """3 n - k degrees of freedom: the noise is found without bias."""
        noise_mm = np.array([result.noise_mm for result in trials.results])
        assert np.sqrt(np.mean(noise_mm**2)) == pytest.approx(NOISE_MM, rel=0.02)
        assert max(rms_mm(each.after_mm) for each in trials.results) < 0.05
        assert min(rms_mm(each.before_mm) for each in trials.results) > 1.0
        assert all(each.rank == len(TOLD) and 1.0 < each.condition < 50.0 for each in trials.results)


@each_scara
def test_exact_measurements_give_the_errors_back(mechanism: Mechanism) -> None:
    """Without noise, from errors of all parameters that can be told apart, found to the last digits."""
    robot = mechanism.robot
    some = calibrated(robot, np.zeros(len(Chain.of(robot).parameters)), seed=3, noise_mm=0.0)
    told = np.array([parameter.identified for parameter in some.parameters])
    sizes = np.random.default_rng(6).normal(0.0, 0.3, told.size)
    result = calibrated(robot, np.where(told, sizes, 0.0), seed=3, noise_mm=0.0)
    found = {p.name: p.found for p in result.parameters if p.identified}
    true = dict(zip(Chain.of(robot).parameters, np.where(told, sizes, 0.0).tolist(), strict=True))
    assert found == pytest.approx({name: true[name] for name in found}, abs=1e-7)
    assert rms_mm(result.after_mm) < 1e-8
    assert {name for name, is_told in zip(true, told.tolist(), strict=True) if is_told} <= found.keys()


@each_scara
def test_errors_of_all_parameters_are_taken_over_by_those_told_apart(mechanism: Mechanism) -> None:
    """The calibrated chain has the tool where it is, at poses that were not measured too."""
    robot = mechanism.robot
    chain = Chain.of(robot)
    sizes = np.array([0.3, 0.1, 0.3, 0.1])
    truth = chain.with_errors(np.random.default_rng(12).normal(0.0, sizes, chain.errors.shape))
    result = calibrated(robot, truth.errors, seed=2)
    assert result.noise_mm == pytest.approx(NOISE_MM, rel=0.25)
    joints = mechanism.random_joints(200, seed=13)
    off_mm = (result.chain.poses(joints) - truth.poses(joints))[:, :3]
    assert rms_mm(off_mm) < NOISE_MM
    assert rms_mm((chain.poses(joints) - truth.poses(joints))[:, :3]) > 10 * NOISE_MM


def test_what_cannot_be_told_apart_is_named() -> None:
    result = calibrated(CALIBRATION.robot, errors_of(CALIBRATION.robot, TOLD), seed=1)
    acts_as = {
        p.name: tuple((round(share, 3), name) for share, name in p.acts_as)
        for p in result.parameters
        if not p.identified
    }
    assert acts_as == {
        "link2.d_mm": ((1.0, "link1.d_mm"),),
        "link3.a_mm": ((1.0, "link2.a_mm"),),
        "link3.alpha_deg": (),
        "link3.d_mm": ((1.0, "link1.d_mm"),),
        "link3.theta_deg": (),
        "link4.alpha_deg": (),
        "link4.d_mm": ((-1.0, "link1.d_mm"),),
        "link4.theta_deg": (),
    }
    assert all(p.found == p.before == 0.0 and p.deviation is None for p in result.parameters if not p.identified)


@each_scara
def test_the_rank_is_that_of_the_singular_values(mechanism: Mechanism) -> None:
    """The nominal chain's dependencies are exact, so a decomposition with other means counts the same."""
    chain = Chain.of(mechanism.robot)
    result = calibrated(mechanism.robot, np.zeros(len(chain.parameters)), seed=3, noise_mm=0.0)
    slopes = chain.sensitivities(result.measurements.joints)[:, :3].reshape(-1, len(chain.parameters))
    assert result.rank == np.linalg.matrix_rank(slopes, rtol=1e-9)


def test_the_tool_s_offset_decides_whether_its_angle_can_be_found() -> None:
    """At an offset of 0.2 mm a degree moves the tool by 3.5 um; at 20 mm by 0.35 mm.

    link3 turns about the same axis, the other way round, and stands nearer to the world.
    """
    for offset_mm, is_told in ((0.2, False), (20.0, True)):
        errors = errors_of(CALIBRATION.robot, TOLD | {"link4.a_mm": offset_mm, "link4.theta_deg": 0.5})
        by_name = {p.name: p for p in calibrated(CALIBRATION.robot, errors, 1).parameters}
        turn = by_name["link3.theta_deg"]
        assert not by_name["link4.theta_deg"].identified
        assert (turn.deviation is not None) == is_told
        if turn.deviation is not None:
            assert turn.found == pytest.approx(-0.5, abs=4 * turn.deviation)
            ((share, name),) = by_name["link4.theta_deg"].acts_as
            assert (round(share, 6), name) == (-1.0, "link3.theta_deg")


def test_a_calibration_begins_with_the_file_s_errors() -> None:
    """Those that cannot be told apart stay; the residual before is that of the file."""
    errors = errors_of(CALIBRATION.robot, TOLD | {"link2.d_mm": 0.75})
    real = with_errors(CALIBRATION.robot, errors)
    result = identify_errors(Chain.of(real), simulate_measurements(real, POSES, NOISE_MM, 4))
    assert rms_mm(result.before_mm) == pytest.approx(NOISE_MM * np.sqrt(3), rel=0.2)
    kept = {p.name: p.found for p in result.parameters if not p.identified}
    assert kept["link2.d_mm"] == 0.75


def test_the_worst_measurement_is_named() -> None:
    measured = simulate_measurements(CALIBRATION.robot, POSES, NOISE_MM, 1)
    shifted_mm = measured.positions_mm.copy()
    shifted_mm[30, 1] += 0.5
    result = identify_errors(Chain.of(CALIBRATION.robot), Measurements.of(measured.joints, shifted_mm))
    assert result.worst_line == 31


class TestMeasurementsThatGiveNothing:
    def test_too_few(self) -> None:
        """8 parameters need 9 coordinates, so that the residuals show the noise: 3 poses."""
        robot = with_errors(CALIBRATION.robot, errors_of(CALIBRATION.robot, TOLD))
        measured = simulate_measurements(robot, 40, NOISE_MM, 1)
        few = Measurements(measured.joints[:2], measured.positions_mm[:2], (2, 3))
        words = complaint_of(lambda: identify_errors(Chain.of(CALIBRATION.robot), few))
        assert words == "too few poses for 6 parameters: 2 instead of at least 3"

    def test_none(self) -> None:
        none = Measurements(np.zeros((0, 4)), np.zeros((0, 3)), ())
        complaint_of(lambda: identify_errors(Chain.of(CALIBRATION.robot), none))

    @pytest.mark.slow
    def test_of_another_machine(self) -> None:
        measured = simulate_measurements(CALIBRATION.robot, POSES, NOISE_MM, 1)
        in_metres = Measurements.of(measured.joints, measured.positions_mm / 1000)
        words = complaint_of(lambda: identify_errors(Chain.of(CALIBRATION.robot), in_metres))
        assert "is outside -" in words
        assert "not of this robot, or not in its world frame, in mm and degrees" in words


@pytest.mark.parametrize(
    ("poses", "noise_mm", "seed"),
    [
        (0, 0.0, 1),
        (10_001, 0.0, 1),
        (1, -0.1, 1),
        (1, 10.1, 1),
        (1, float("nan"), 1),
        (1, 0.0, -1),
    ],
)
def test_simulations_that_are_refused(poses: int, noise_mm: float, seed: int) -> None:
    complaint_of(lambda: simulate_measurements(CALIBRATION.robot, poses, noise_mm, seed))


def test_a_simulation_repeats_itself() -> None:
    for mechanism in SCARAS:
        first, second, other = (simulate_measurements(mechanism.robot, 20, 0.02, seed) for seed in (7, 7, 8))
        assert first.joints.tolist() == second.joints.tolist()
        assert first.positions_mm.tolist() == second.positions_mm.tolist()
        assert first.joints.tolist() != other.joints.tolist()
        lower, upper = (np.array([getattr(j, end) for j in mechanism.robot.joints]) for end in ("lower", "upper"))
        assert ((first.joints >= lower) & (first.joints <= upper)).all()
        off_mm = first.positions_mm - mechanism.kinematics.forward(first.joints)[:, :3]
        assert np.std(off_mm) == pytest.approx(0.02, rel=0.4)
