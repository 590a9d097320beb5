"""Identify a machine's DH parameters from measured positions of its tool, by nonlinear least squares.

Positions cannot tell all parameters apart: heights of several links add up, a twist of the last frame moves nothing. So
parameters are taken in order, from the world to the tool. A parameter is identified if its error moves the tool in a
way that those before it cannot. The others keep their values; their effect is a combination of identified parameters,
which take over their errors. Source: W. Khalil, E. Dombre, "Modeling, Identification and Control of Robots", section
11.4, there by a QR decomposition with permuted columns.

Standard deviations are those of linear least squares at the solution, from the residuals' own variance:

    s^2 = sum r^2 / (3 n - k)        covariance = s^2 (J^T J)^-1        n measurements, k parameters
"""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import count
from typing import Final

import numpy as np

from steptwin.features.calibration.measurements import Measurements
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time, in_planning_time, planning_step
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.link_errors import LinkErrors, check_size
from steptwin.host.robots.reader import read_robot
from steptwin.host.robots.robot import Robot

LEAST_OWN_MOVE_MM: Final = 0.01
"""Least rms motion of the tool, per mm or degree of a parameter, that no other parameters can make. A measuring device
of 0.02 mm and 50 poses find such a parameter to 0.3 mm or degrees.
"""

_FREE_ROUNDS: Final = 3  # largest number of fits; guarantees an end
_EXACT: Final = 1e-14  # relative change of parameters or residual below which a fit has converged
_DECIMALS: Final = 7  # of an error in a file: a ten thousandth of a micrometre, or 2 nm at the end of an arm of 1 m


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of the chain after the calibration."""

    name: str  # such as link1.a_mm
    before: float  # its error in the robot's file, real minus nominal, in mm or degrees
    found: float  # the error found; unchanged if it was not identified
    deviation: float | None  # standard deviation of the error found; None if it was not identified
    acts_as: tuple[tuple[float, str], ...] = ()
    """For a parameter that was not identified: identified ones of like effect, with their errors for an error of 1."""

    @property
    def identified(self) -> bool:
        """True if the parameter was told apart from the others."""
        return self.deviation is not None


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """The result of a calibration.

    Attributes:
        chain: chain with the errors found.
        measurements: measurements that it was found from.
        parameters: all parameters of the chain, from the world to the tool, each with `name`, `before`, `found`,
            `deviation` (None if it was not identified) and `acts_as`.
        before_mm: measured positions minus those by the old chain, shape (n, 3).
        after_mm: measured positions minus those by the new chain, shape (n, 3).
        condition: condition number of the identified parameters' derivatives, per mm and per degree.
        noise_mm: standard deviation of a measured coordinate, from the residuals.
    """

    chain: Chain
    measurements: Measurements
    parameters: tuple[Parameter, ...]
    before_mm: FloatArray
    after_mm: FloatArray
    condition: float
    noise_mm: float

    @property
    def rank(self) -> int:
        """Number of parameters that could be told apart."""
        return sum(parameter.identified for parameter in self.parameters)

    @property
    def worst_line(self) -> int:
        """Line of the measurement farthest from the new chain."""
        return self.measurements.lines[int(np.linalg.norm(self.after_mm, axis=1).argmax())]


@in_planning_time()
def identify_errors(chain: Chain, measurements: Measurements) -> Identification:
    """Fit a chain's parameters to measurements, starting with the chain's own errors.

    Raises:
        InputError: there are too few measurements, or they belong to another robot.
    """
    with planning_step("the calibration"):
        found, told = _fitted_and_identified(chain, measurements)
    after_mm, slopes = _residuals(found, measurements), _slopes(found, measurements)
    freedom = after_mm.size - int(told.sum())
    noise_mm = float(np.sqrt(np.sum(after_mm**2) / freedom))
    return Identification(
        found,
        measurements,
        _parameters(chain, found, slopes, told, noise_mm),
        _residuals(chain, measurements),
        after_mm,
        float(np.linalg.cond(slopes[:, told])),
        noise_mm,
    )


def rms_mm(residuals_mm: FloatArray) -> float:
    """Return the root of the mean square of the distances, for residuals of shape (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(residuals_mm**2, axis=1))))


def _residuals(chain: Chain, measurements: Measurements) -> FloatArray:
    return measurements.positions_mm - chain.transforms(measurements.joints)[:, :3, 3]


def _slopes(chain: Chain, measurements: Measurements) -> FloatArray:
    """Return the derivatives of all coordinates by all parameters, of shape (3 n, parameters)."""
    return chain.sensitivities(measurements.joints)[:, :3].reshape(3 * len(measurements), -1)


def _independent(slopes: FloatArray, preferred: BoolArray) -> BoolArray:
    """Return the parameters that move the tool in a way of their own, preferred ones first (Gram-Schmidt)."""
    least = LEAST_OWN_MOVE_MM * np.sqrt(len(slopes) / 3)
    told = np.zeros_like(preferred)
    basis = np.zeros((len(slopes), 0))
    for i in np.argsort(~preferred, kind="stable").tolist():
        slope = slopes[:, i]
        own = slope - basis @ (basis.T @ slope)
        own -= basis @ (basis.T @ own)  # again, to remove rounding errors of the large part
        size = np.linalg.norm(own)
        if size >= least:
            told[i] = True
            basis = np.column_stack([basis, own / size])
    return told


def _fitted_and_identified(chain: Chain, measurements: Measurements) -> tuple[Chain, BoolArray]:
    """Return the fitted chain and the identified parameters.

    The identified set depends on the values: the angle of a tool without an offset cannot be identified. So each fit
    starts at the last solution with the parameters that can be told apart there, until the set repeats. Parameters of
    the last set are preferred: with an offset, the tool's angle must not replace a direction of the offset, which would
    need a large turn.
    """
    if not len(measurements):
        raise InputError("has no measurement")
    told = _independent(_slopes(chain, measurements), np.zeros(chain.errors.size, dtype=np.bool_))
    found = chain
    for fits in count(1):
        check_planning_time()
        _check_enough(measurements, int(told.sum()))
        start = found.with_errors(np.where(told, found.errors.ravel(), chain.errors.ravel()))
        found = _fitted(start, measurements, told)
        at_solution = _independent(_slopes(found, measurements), told)
        if fits >= _FREE_ROUNDS:
            at_solution &= told
        if (at_solution == told).all():
            break
        told = at_solution
    return found, told


def _check_enough(measurements: Measurements, parameters: int) -> None:
    """Raise InputError if coordinates do not outnumber parameters; residuals could not show the noise then."""
    needed = parameters // 3 + 1
    if len(measurements) < needed:
        there = f"{len(measurements)} instead of at least {needed}"
        if measurements.repeats:
            there += f"; repeated poses count once, and {measurements.repeats} of the measurements repeat one"
        raise InputError(f"too few poses for {parameters} parameters: {there}")


def _fitted(chain: Chain, measurements: Measurements, told: BoolArray) -> Chain:
    """Return a chain with the best-fitting errors of the given parameters."""
    from scipy.optimize import least_squares

    def with_values(values: FloatArray) -> Chain:
        errors = chain.errors.ravel().copy()
        errors[told] = values
        return chain.with_errors(errors)

    def residuals(values: FloatArray) -> FloatArray:
        check_planning_time()
        return _residuals(with_values(values), measurements).ravel()

    def slopes(values: FloatArray) -> FloatArray:
        return -_slopes(with_values(values), measurements)[:, told]

    start = chain.errors.ravel()[told]
    fit = least_squares(residuals, start, jac=slopes, method="lm", xtol=_EXACT, ftol=_EXACT, gtol=_EXACT)
    found = with_values(fit.x)
    for name, error in zip(chain.parameters, found.errors.ravel().tolist(), strict=True):
        try:
            check_size(name, error)
        except InputError as beyond:
            reason = "the measurements are not of this robot, or not in its world frame, in mm and degrees"
            raise InputError(f"{beyond}: {reason}") from beyond
    return found


def _parameters(
    before: Chain, found: Chain, slopes: FloatArray, told: BoolArray, noise_mm: float
) -> tuple[Parameter, ...]:
    own = slopes[:, told]
    deviations = iter(noise_mm * np.sqrt(np.diag(np.linalg.inv(own.T @ own))))
    names = before.parameters
    told_names = [name for name, is_told in zip(names, told, strict=True) if is_told]
    shares, *_ = np.linalg.lstsq(own, slopes, rcond=None)  # of shape (told, parameters)
    moves_mm = np.linalg.norm(own, axis=0) / np.sqrt(len(slopes) / 3)
    shares[np.abs(shares) * moves_mm[:, None] < LEAST_OWN_MOVE_MM] = 0.0
    return tuple(
        Parameter(
            name,
            float(before.errors.flat[i]),
            float(found.errors.flat[i]),
            float(next(deviations)) if told[i] else None,
            () if told[i] else tuple((float(s), n) for s, n in zip(shares[:, i], told_names, strict=True) if s),
        )
        for i, name in enumerate(names)
    )


def corrected_text(robot: Robot, errors: Mapping[str, LinkErrors], comment: str) -> str:
    """Return the text of a robot's file with other errors of its links; each table's head gets a comment.

    Raises:
        InputError: the robot has no file, or the file gives errors in a form that cannot be replaced.
    """
    if not robot.toml:
        raise InputError("the robot is not from a file: there is no text to correct")
    tables, given = [], {}
    for link, each in errors.items():
        sizes = {quantity: rounded for quantity, error in asdict(each).items() if (rounded := round(error, _DECIMALS))}
        if sizes:
            given[link] = LinkErrors(**sizes)
            lines = (f"{quantity} = {error:.{_DECIMALS}f}\n" for quantity, error in sizes.items())
            tables.append("".join([f"[dh_errors.{link}] # {comment}\n", *lines]))
    text = "\n".join([f"{_without_errors(robot.toml).rstrip()}\n", *tables])
    if read_robot(text) != replace(robot, dh_errors=given):
        raise InputError("dh_errors: the errors in the robot's file cannot be replaced")
    return text


def _without_errors(text: str) -> str:
    """Return the text without the tables of errors."""
    kept, inside = [], False
    for line in text.splitlines(keepends=True):
        head = line.strip()
        if head.startswith("["):
            inside = head.startswith(("[dh_errors]", "[dh_errors."))
        if not inside:
            kept.append(line)
    rest = "".join(kept)
    if "dh_errors" in tomllib.loads(rest):
        raise InputError(
            "dh_errors: stands in a line of its own; only tables such as [dh_errors.link1] can be replaced"
        )
    return rest
