"""The arm's mechanics: mass matrix and bias force of a chain of rigid bodies, by recursive Newton-Euler.

Source: J. Y. S. Luh, M. W. Walker, R. P. C. Paul, "On-line computational scheme for mechanical manipulators", ASME
J. Dynamic Systems 102, 1980, in frames of the links (J. J. Craig, "Introduction to Robotics", section 6.5), on a tree
instead of a chain. Each body hangs on its parent by one joint, which turns about or slides along the z axis of the
frame where it is fixed to the parent:

    frame of a body in its parent's = fixed transform, then Rz(angle) or Tz(way)

SI units: m, rad, kg, N m. Functions are plain and give the same bytes compiled by numba (`rotor_kernel`).
"""

from typing import NamedTuple

from steptwin.controller.motion.kernel import kernel_function
from steptwin.features.motors.rotors.following import ArmArrays, JointArrays, follow
from steptwin.features.motors.rotors.rotor_kernel import (
    AXIS_FIELDS,
    ELASTIC,
    INERTIA,
    PLACE,
    RATE,
    STATE_FIELDS,
    RotorArrays,
    sine_cosine,
)

PARENT = 0
"""Index of the parent, -1 for the base; less than the body's own."""
SLIDES = 1
"""1 if the joint slides, 0 if it turns."""
FIXED = 2
"""Nine numbers, the rotation of the fixed transform row by row."""
SHIFT = 11
"""Three numbers, its shift in m."""
MASS = 14
"""In kg."""
CENTRE = 15
"""Three numbers, the centre of mass in the body's frame in m."""
TENSOR = 18
"""Six numbers, the inertia about the centre of mass: xx, yy, zz, xy, xz, yz in kg m^2."""
BODY_FIELDS = 24

ROTATION = 0
"""Nine numbers, the rotation from the body's frame to its parent's, row by row."""
ORIGIN = 9
"""Three numbers, the body's origin in its parent's frame."""
SPIN = 12
"""Three numbers, the angular velocity in the body's frame."""
SPIN_RATE = 15
"""Three numbers, the angular acceleration."""
LINEAR = 18
"""Three numbers, the acceleration of the origin less gravity."""
FORCE = 21
"""Three numbers, the force through the body's joint."""
MOMENT = 24
"""Three numbers, the moment about the body's origin."""
MOTION_FIELDS = 27

GRAVITY_M_S2 = 9.80665
"""Standard gravity, against z of the base (CGPM 1901)."""


@kernel_function
def take_pose(bodies: list[float], motion: list[float], positions: list[float], count: int) -> None:
    """Compute each body's rotation and origin in its parent's frame at the joints' positions in rad and m."""
    for body in range(count):
        b, m = body * BODY_FIELDS, body * MOTION_FIELDS
        if bodies[b + SLIDES] > 0.0:
            s, c, way = 0.0, 1.0, positions[body]
        else:
            s, c = sine_cosine(positions[body])
            way = 0.0
        for row in range(3):
            first, second = bodies[b + FIXED + 3 * row], bodies[b + FIXED + 3 * row + 1]
            third = bodies[b + FIXED + 3 * row + 2]
            motion[m + ROTATION + 3 * row] = first * c + second * s
            motion[m + ROTATION + 3 * row + 1] = second * c - first * s
            motion[m + ROTATION + 3 * row + 2] = third
            motion[m + ORIGIN + row] = bodies[b + SHIFT + row] + third * way


@kernel_function
def into_body(motion: list[float], m: int, x: float, y: float, z: float, row: int) -> float:
    """Return a coordinate, in the body's frame, of a vector in its parent's."""
    r = m + ROTATION
    return motion[r + row] * x + motion[r + 3 + row] * y + motion[r + 6 + row] * z


@kernel_function
def out_of_body(motion: list[float], m: int, vector: int, row: int) -> float:
    """Return a coordinate, in the parent's frame, of one of the body's vectors."""
    r = m + ROTATION + 3 * row
    return motion[r] * motion[vector] + motion[r + 1] * motion[vector + 1] + motion[r + 2] * motion[vector + 2]


@kernel_function
def move_body(
    bodies: list[float], motion: list[float], body: int, rate: float, acceleration: float, gravity: float
) -> None:
    """Compute a body's spin and accelerations from its parent's and its joint's rate and acceleration."""
    b, m = body * BODY_FIELDS, body * MOTION_FIELDS
    parent = int(bodies[b + PARENT])
    wx = wy = wz = ax = ay = 0.0
    dx = dy = dz = 0.0
    az = gravity
    if parent >= 0:
        q = parent * MOTION_FIELDS
        wx, wy, wz = motion[q + SPIN], motion[q + SPIN + 1], motion[q + SPIN + 2]
        dx, dy, dz = motion[q + SPIN_RATE], motion[q + SPIN_RATE + 1], motion[q + SPIN_RATE + 2]
        ax, ay, az = motion[q + LINEAR], motion[q + LINEAR + 1], motion[q + LINEAR + 2]
    px, py, pz = motion[m + ORIGIN], motion[m + ORIGIN + 1], motion[m + ORIGIN + 2]
    vx, vy, vz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
    lx = ax + dy * pz - dz * py + wy * vz - wz * vy
    ly = ay + dz * px - dx * pz + wz * vx - wx * vz
    lz = az + dx * py - dy * px + wx * vy - wy * vx
    for row in range(3):
        motion[m + SPIN + row] = into_body(motion, m, wx, wy, wz, row)
        motion[m + SPIN_RATE + row] = into_body(motion, m, dx, dy, dz, row)
        motion[m + LINEAR + row] = into_body(motion, m, lx, ly, lz, row)
    spin_x, spin_y = motion[m + SPIN], motion[m + SPIN + 1]
    if bodies[b + SLIDES] > 0.0:
        motion[m + LINEAR] += 2.0 * spin_y * rate
        motion[m + LINEAR + 1] -= 2.0 * spin_x * rate
        motion[m + LINEAR + 2] += acceleration
    else:
        motion[m + SPIN_RATE] += spin_y * rate
        motion[m + SPIN_RATE + 1] -= spin_x * rate
        motion[m + SPIN_RATE + 2] += acceleration
        motion[m + SPIN + 2] += rate


@kernel_function
def load_body(bodies: list[float], motion: list[float], body: int) -> None:
    """Compute the force and moment that a body's own motion needs."""
    b, m = body * BODY_FIELDS, body * MOTION_FIELDS
    wx, wy, wz = motion[m + SPIN], motion[m + SPIN + 1], motion[m + SPIN + 2]
    dx, dy, dz = motion[m + SPIN_RATE], motion[m + SPIN_RATE + 1], motion[m + SPIN_RATE + 2]
    cx, cy, cz = bodies[b + CENTRE], bodies[b + CENTRE + 1], bodies[b + CENTRE + 2]
    vx, vy, vz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
    mass, t = bodies[b + MASS], b + TENSOR
    fx = mass * (motion[m + LINEAR] + dy * cz - dz * cy + wy * vz - wz * vy)
    fy = mass * (motion[m + LINEAR + 1] + dz * cx - dx * cz + wz * vx - wx * vz)
    fz = mass * (motion[m + LINEAR + 2] + dx * cy - dy * cx + wx * vy - wy * vx)
    xx, yy, zz = bodies[t], bodies[t + 1], bodies[t + 2]
    xy, xz, yz = bodies[t + 3], bodies[t + 4], bodies[t + 5]
    hx, hy, hz = xx * wx + xy * wy + xz * wz, xy * wx + yy * wy + yz * wz, xz * wx + yz * wy + zz * wz
    nx = xx * dx + xy * dy + xz * dz + wy * hz - wz * hy
    ny = xy * dx + yy * dy + yz * dz + wz * hx - wx * hz
    nz = xz * dx + yz * dy + zz * dz + wx * hy - wy * hx
    motion[m + FORCE], motion[m + FORCE + 1], motion[m + FORCE + 2] = fx, fy, fz
    motion[m + MOMENT] = nx + cy * fz - cz * fy
    motion[m + MOMENT + 1] = ny + cz * fx - cx * fz
    motion[m + MOMENT + 2] = nz + cx * fy - cy * fx


@kernel_function
def pass_to_parent(motion: list[float], body: int, parent: int) -> None:
    """Add a body's force and moment to its parent's."""
    m, q = body * MOTION_FIELDS, parent * MOTION_FIELDS
    fx, fy = out_of_body(motion, m, m + FORCE, 0), out_of_body(motion, m, m + FORCE, 1)
    fz = out_of_body(motion, m, m + FORCE, 2)
    px, py, pz = motion[m + ORIGIN], motion[m + ORIGIN + 1], motion[m + ORIGIN + 2]
    motion[q + FORCE] += fx
    motion[q + FORCE + 1] += fy
    motion[q + FORCE + 2] += fz
    motion[q + MOMENT] += out_of_body(motion, m, m + MOMENT, 0) + py * fz - pz * fy
    motion[q + MOMENT + 1] += out_of_body(motion, m, m + MOMENT, 1) + pz * fx - px * fz
    motion[q + MOMENT + 2] += out_of_body(motion, m, m + MOMENT, 2) + px * fy - py * fx


@kernel_function
def inverse_dynamics(
    bodies: list[float], motion: list[float], rates: list[float], accelerations: list[float], gravity: float,
    torques: list[float], count: int,
) -> None:  # fmt: skip
    """Compute the torque or force that each joint needs, at the pose of `take_pose`."""
    for body in range(count):
        move_body(bodies, motion, body, rates[body], accelerations[body], gravity)
        load_body(bodies, motion, body)
    for body in range(count - 1, -1, -1):
        m = body * MOTION_FIELDS
        torques[body] = motion[m + FORCE + 2] if bodies[body * BODY_FIELDS + SLIDES] > 0.0 else motion[m + MOMENT + 2]
        parent = int(bodies[body * BODY_FIELDS + PARENT])
        if parent >= 0:
            pass_to_parent(motion, body, parent)


@kernel_function
def mass_matrix(
    bodies: list[float], motion: list[float], zeros: list[float], unit: list[float], column: list[float],
    matrix: list[float], count: int,
) -> None:  # fmt: skip
    """Compute the mass matrix, row by row, at the pose of `take_pose`.

    `zeros` and `unit` hold 0, `column` is working storage; all three have one number for each body.
    """
    for body in range(count):
        unit[body] = 1.0
        inverse_dynamics(bodies, motion, zeros, unit, 0.0, column, count)
        unit[body] = 0.0
        for row in range(count):
            matrix[row * count + body] = column[row]


@kernel_function
def invert(matrix: list[float], inverse: list[float], count: int) -> None:
    """Invert a symmetric positive definite matrix and destroy it; Gauss-Jordan needs no pivots for it."""
    for row in range(count):
        for column in range(count):
            inverse[row * count + column] = 1.0 if row == column else 0.0
    for pivot in range(count):
        scale = 1.0 / matrix[pivot * count + pivot]
        for column in range(count):
            matrix[pivot * count + column] *= scale
            inverse[pivot * count + column] *= scale
        for row in range(count):
            factor = matrix[row * count + pivot]
            if row != pivot and factor != 0.0:
                for column in range(count):
                    matrix[row * count + column] -= factor * matrix[pivot * count + column]
                    inverse[row * count + column] -= factor * inverse[pivot * count + column]


@kernel_function
def project(
    masses: list[float], torques: list[float], slopes: list[float], axes: list[float], matrix: list[float],
    bias: list[float], count: int, axis_count: int,
) -> None:  # fmt: skip
    """Compute S^T M S + rotors' inertia and S^T h from the bodies' mass matrix M and torques h."""
    for axis in range(axis_count):
        total = 0.0
        for body in range(count):
            total += slopes[body * axis_count + axis] * torques[body]
        bias[axis] = total
        for other in range(axis_count):
            value = 0.0
            for body in range(count):
                slope = slopes[body * axis_count + axis]
                if slope != 0.0:
                    for column in range(count):
                        value += slope * masses[body * count + column] * slopes[column * axis_count + other]
            matrix[axis * axis_count + other] = value
        if axes[axis * AXIS_FIELDS + ELASTIC] == 0.0:
            matrix[axis * axis_count + axis] += axes[axis * AXIS_FIELDS + INERTIA]


class MassArrays(NamedTuple):
    """Working storage for the mass matrix.

    Attributes:
        zeros: 0 for each body; nothing writes into it.
        unit: 0 for each body between the calls.
        torques: one number for each body.
        masses: bodies x bodies.
        matrix: axes x axes.
    """

    zeros: list[float]
    unit: list[float]
    torques: list[float]
    masses: list[float]
    matrix: list[float]


@kernel_function
def refresh(arm: ArmArrays, joints: JointArrays, work: MassArrays, rotors: RotorArrays) -> None:
    """Compute the inverse of the mass matrix and the bias force in rotor coordinates; store both in `rotors`.

    The joint positions s follow the rotor coordinates x. Let S = ds/dx be the arm's slopes, and S' dx/dt the joints'
    drifts, which are the joint accelerations without any of the rotors. Then

        M_x = S^T M_s S + rotors' inertia        h_x = S^T (M_s S' dx/dt + h_s)

    A stiff axis adds its rotor's inertia.
    """
    bodies, motion, count = arm.bodies, joints.motion, arm.body_count
    take_pose(bodies, motion, joints.places, count)
    mass_matrix(bodies, motion, work.zeros, work.unit, work.torques, work.masses, count)
    inverse_dynamics(bodies, motion, joints.rates, joints.drifts, arm.gravity_m_s2, work.torques, count)
    project(work.masses, work.torques, arm.slopes, rotors.axes, work.matrix, rotors.bias, count, arm.axis_count)
    invert(work.matrix, rotors.inverse, arm.axis_count)


class MotionArrays(NamedTuple):
    """A motion of all rotors and its torques: one number for each axis and instant, instant after instant.

    Attributes:
        rad: the rotors' angles.
        rad_s: their speeds.
        rad_s2: their accelerations.
        torques: the result in Nm.
    """

    rad: list[float]
    rad_s: list[float]
    rad_s2: list[float]
    torques: list[float]


@kernel_function
def needed_by(
    arm: ArmArrays, joints: JointArrays, state: list[float], accelerations: list[float], joint_torques: list[float],
    asked: MotionArrays,
) -> None:  # fmt: skip
    """Compute the torque that the arm needs at each rotor at many instants.

    `state` has STATE_FIELDS numbers for each axis, `accelerations` and `joint_torques` one for each body; all three are
    working storage.
    """
    bodies, slopes, count, axis_count = arm.bodies, arm.slopes, arm.body_count, arm.axis_count
    for first in range(0, len(asked.rad), axis_count):
        for axis in range(axis_count):
            state[axis * STATE_FIELDS + PLACE] = asked.rad[first + axis]
            state[axis * STATE_FIELDS + RATE] = asked.rad_s[first + axis]
        follow(arm, state, joints)
        for body in range(count):
            acceleration = joints.drifts[body]
            for axis in range(axis_count):
                acceleration += slopes[body * axis_count + axis] * asked.rad_s2[first + axis]
            accelerations[body] = acceleration
        take_pose(bodies, joints.motion, joints.places, count)
        inverse_dynamics(bodies, joints.motion, joints.rates, accelerations, arm.gravity_m_s2, joint_torques, count)
        for axis in range(axis_count):
            torque = 0.0
            for body in range(count):
                torque += slopes[body * axis_count + axis] * joint_torques[body]
            asked.torques[first + axis] = torque
