"""Measured positions of a machine's tool, from a CSV file or simulated.

A file has the header JOINT,...,x,y,z in mm and degrees, in any order of the columns, and one line for each pose.
Positions are in the robot's world frame.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import nearest_within, outside, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import MIB
from steptwin.host.common.numbers import check_once, fields_of, numbered_lines, numbers_of
from steptwin.host.common.own_files import opened_text
from steptwin.host.robots.kinematics.base import LIMIT_TOLERANCE
from steptwin.host.robots.kinematics.chain import Chain, random_joints
from steptwin.host.robots.robot import Robot

MEASUREMENTS_MAX: Final = 10_000
"""Measurements of a calibration: some 50 are usual; the derivatives of so many by 24 parameters take 6 MB."""
MEASUREMENTS_BYTES_MAX: Final = 16 * MIB
"""A measurement of eight joints with all digits has 250 bytes."""
_POSITION: Final = ("x", "y", "z")
_JOINT_DECIMALS: Final = 3  # joints closer than this are the same pose
_POSITION_DECIMALS: Final = 6
NOISE_MAX_MM: Final = 10.0  # largest noise of a useful measuring device


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """Measured positions of the tool.

    Attributes:
        joints: joint positions in mm and degrees, shape (n, joints).
        positions_mm: positions of the tool, shape (n, 3).
        lines: line numbers in the file; from 1 for measurements without a file.
        repeats: number of further lines of the file at a repeated pose.
    """

    joints: FloatArray
    positions_mm: FloatArray
    lines: tuple[int, ...]
    repeats: int = 0

    @classmethod
    def of(cls, joints: FloatArray, positions_mm: FloatArray) -> Self:
        """Return measurements without a file."""
        return cls(joints, positions_mm, tuple(range(1, len(joints) + 1)))

    def __len__(self) -> int:
        return len(self.lines)


def read_measurements(path: Path | str, robot: Robot) -> Measurements:
    """Read measurements from a file; raise InputError with path, line and column for errors.

    A repeated pose counts once, with its average position. Repetitions show the device's noise, but nothing new about
    the arm.
    """
    with prefixed(f"{path}: "), opened_text(path, MEASUREMENTS_BYTES_MAX) as file:
        lines = numbered_lines(file)
        wanted = [*robot.joint_names, *_POSITION]
        head = next(lines, None)
        if head is None:
            raise InputError(f"is empty: a header {','.join(wanted)} was expected")
        header = fields_of(*head)
        with prefixed(f"line {head[0]}: "):
            _check_header(header, wanted)
        rows: dict[int, list[float]] = {}
        for i, line in lines:
            if len(rows) == MEASUREMENTS_MAX:
                raise InputError(f"line {i}: is beyond {MEASUREMENTS_MAX} measurements")
            values = dict(zip(header, numbers_of(i, fields_of(i, line), header), strict=True))
            for joint in robot.joints:
                limits = (joint.lower, joint.upper, joint.unit)
                if not joint.lower - LIMIT_TOLERANCE <= (value := values[joint.name]) <= joint.upper + LIMIT_TOLERANCE:
                    near = nearest_within(value, *limits)
                    raise InputError(f"line {i}, {joint.name}: {outside(value, *limits)}{near}")
            rows[i] = [values[name] for name in wanted]
    return _once_each(rows, len(robot.joints))


def _check_header(header: list[str], wanted: list[str]) -> None:
    check_once(header)
    for name in header:
        if name not in wanted:
            raise unknown("column", name, wanted)
    for name in wanted:
        if name not in header:
            raise InputError(f"column {name!r} is missing: the header is {','.join(wanted)}, in any order")


def _once_each(rows: dict[int, list[float]], joints: int) -> Measurements:
    """Return one measurement for each pose: the average, under its first line."""
    poses: dict[tuple[float, ...], list[int]] = {}
    for line, row in rows.items():
        poses.setdefault(tuple(round(value, _JOINT_DECIMALS) for value in row[:joints]), []).append(line)
    table = np.array([np.mean([rows[line] for line in lines], axis=0) for lines in poses.values()])
    table = table.reshape(len(poses), joints + len(_POSITION))
    first_lines = tuple(lines[0] for lines in poses.values())
    return Measurements(table[:, :joints], table[:, joints:], first_lines, len(rows) - len(poses))


def measurements_text(robot: Robot, measurements: Measurements) -> str:
    """Return measurements as the text of a file."""
    rows = [
        [f"{value:.{_JOINT_DECIMALS}f}" for value in joints]
        + [f"{value:z.{_POSITION_DECIMALS}f}" for value in position]
        for joints, position in zip(measurements.joints.tolist(), measurements.positions_mm.tolist(), strict=True)
    ]
    return "".join(f"{','.join(row)}\n" for row in [[*robot.joint_names, *_POSITION], *rows])


def simulate_measurements(robot: Robot, poses: int, noise_mm: float, seed: int) -> Measurements:
    """Return measurements of the actual tool at uniformly random joints; link errors of the file are included.

    Each measured coordinate has normally distributed noise; the seed determines the result.

    Raises:
        InputError: the robot is no DH chain, or a number is out of range.
    """
    if not 1 <= poses <= MEASUREMENTS_MAX:
        raise InputError(f"poses={poses}: is outside 1..{MEASUREMENTS_MAX}")
    if not 0.0 <= noise_mm <= NOISE_MAX_MM:
        raise InputError(f"noise_mm={noise_mm:g}: is outside 0..{NOISE_MAX_MM:g} mm")
    if seed < 0:
        raise InputError(f"seed={seed}: is below 0")
    random = np.random.default_rng(seed)
    joints = random_joints(robot, poses, random)
    positions_mm = Chain.of(robot).poses(joints)[:, :3]
    return Measurements.of(joints, positions_mm + random.normal(0.0, noise_mm, positions_mm.shape))
