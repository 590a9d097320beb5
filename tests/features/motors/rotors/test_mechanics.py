"""Recursive Newton-Euler against Lagrange's equations, which are derived here from energies by differentiation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.features.motors.rotors import mechanics
from steptwin.features.motors.rotors.arm import BASE, Arm, Body
from steptwin.features.motors.rotors.following import ArmArrays, JointArrays, follow
from steptwin.features.motors.rotors.mechanics import GRAVITY_M_S2, MOTION_FIELDS
from steptwin.features.motors.rotors.motor import CATALOGUE
from steptwin.features.motors.rotors.rotor_backend import RotorBackend, compiled_rotors, python_rotors
from steptwin.features.motors.rotors.rotor_kernel import DT_COUNTS, EventArrays, RotorArrays, advance_rotors
from steptwin.features.motors.rotors.rotor_run import REFRESH_STEPS, keep
from steptwin.features.motors.rotors.rotors import Drive, DriverEvents, Rotors

Array = NDArray[np.float64]
STEP = 1e-4


def random_tree(seed: int, count: int = 6) -> tuple[Body, ...]:
    """Return bodies that turn and slide, some with a common parent."""
    random = np.random.default_rng(seed)
    bodies = []
    for index in range(count):
        fixed = np.eye(4)
        rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
        fixed[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
        fixed[:3, 3] = random.uniform(-0.3, 0.3, 3)
        root = random.normal(size=(3, 3)) * 0.1
        parent = BASE if index == 0 else int(random.integers(max(0, index - 2), index))
        bodies.append(
            Body(
                parent, bool(random.integers(2)), fixed, float(random.uniform(0.2, 3.0)),
                random.uniform(-0.1, 0.1, 3), root @ root.T + 0.01 * np.eye(3),
            )
        )  # fmt: skip
    return tuple(bodies)


def poses(bodies: tuple[Body, ...], places: Array) -> list[Array]:
    """Return each body's frame in the world."""
    frames: list[Array] = []
    for body, place in zip(bodies, places, strict=True):
        joint = np.eye(4)
        if body.slides:
            joint[2, 3] = place
        else:
            joint[:2, :2] = [[np.cos(place), -np.sin(place)], [np.sin(place), np.cos(place)]]
        parent = np.eye(4) if body.parent == BASE else frames[body.parent]
        frames.append(parent @ body.fixed @ joint)
    return frames


def slopes_of(bodies: tuple[Body, ...], places: Array) -> tuple[Array, Array]:
    """Return the derivatives of centres, (bodies, 3, n), and of attitudes, by the geometry of axes."""
    frames, count = poses(bodies, places), len(bodies)
    linear, angular = np.zeros((count, 3, count)), np.zeros((count, 3, count))
    for index, body in enumerate(bodies):
        centre = frames[index][:3, :3] @ body.centre_m + frames[index][:3, 3]
        joint = index
        while joint != BASE:
            axis, origin = frames[joint][:3, 2], frames[joint][:3, 3]
            if bodies[joint].slides:
                linear[index, :, joint] = axis
            else:
                linear[index, :, joint] = np.cross(axis, centre - origin)
                angular[index, :, joint] = axis
            joint = bodies[joint].parent
    return linear, angular


def masses_of(bodies: tuple[Body, ...], places: Array) -> Array:
    """Return the mass matrix as the Hessian of the kinetic energy."""
    linear, angular = slopes_of(bodies, places)
    total = np.zeros((len(bodies), len(bodies)))
    for index, (body, frame) in enumerate(zip(bodies, poses(bodies, places), strict=True)):
        tensor = frame[:3, :3] @ body.inertia_kgm2 @ frame[:3, :3].T
        total += body.mass_kg * linear[index].T @ linear[index] + angular[index].T @ tensor @ angular[index]
    return total


def weights_of(bodies: tuple[Body, ...], places: Array) -> Array:
    """Return the torques that hold the weights."""
    linear, _ = slopes_of(bodies, places)
    return np.asarray(sum(GRAVITY_M_S2 * body.mass_kg * linear[i, 2] for i, body in enumerate(bodies)))


def lagrange(bodies: tuple[Body, ...], places: Array, rates: Array, accelerations: Array) -> Array:
    """Return the torques by Lagrange's equations, the mass matrix differentiated by fourth-order differences."""
    count = len(bodies)

    def slope(joint: int) -> Array:
        unit = STEP * np.eye(count)[joint]
        near = masses_of(bodies, places + unit) - masses_of(bodies, places - unit)
        far = masses_of(bodies, places + 2 * unit) - masses_of(bodies, places - 2 * unit)
        return (8 * near - far) / (12 * STEP)

    by_joint = np.array([slope(joint) for joint in range(count)])
    moving = np.einsum("kij,k,j->i", by_joint, rates, rates) - np.einsum("ijk,j,k->i", by_joint, rates, rates) / 2
    return np.asarray(masses_of(bodies, places) @ accelerations + moving + weights_of(bodies, places))


def by_virtual_power(bodies: tuple[Body, ...], places: Array, rates: Array, accelerations: Array) -> Array:
    """Return the torques as the forces of inertia of all bodies, each times the way that a joint gives it.

    Everything is in the world's frame; no force is passed from body to body.
    """
    frames, (linear, angular) = poses(bodies, places), slopes_of(bodies, places)
    spins, spin_rates, origins = ([np.zeros(3)] * len(bodies) for _ in range(3))
    torques = np.zeros(len(bodies))
    for index, body in enumerate(bodies):
        on_base = body.parent == BASE
        spin, spin_rate, moved = (
            np.zeros(3) if on_base else each[body.parent] for each in (spins, spin_rates, origins)
        )
        way = frames[index][:3, 3] - (np.zeros(3) if on_base else frames[body.parent][:3, 3])
        axis, rate, acceleration = frames[index][:3, 2], rates[index], accelerations[index]
        moved = moved + np.cross(spin_rate, way) + np.cross(spin, np.cross(spin, way))
        if body.slides:
            moved = moved + 2.0 * np.cross(spin, axis) * rate + axis * acceleration
        else:
            spin_rate = spin_rate + axis * acceleration + np.cross(spin, axis) * rate
            spin = spin + axis * rate
        spins[index], spin_rates[index], origins[index] = spin, spin_rate, moved
        arm = frames[index][:3, :3] @ body.centre_m
        centre = moved + np.cross(spin_rate, arm) + np.cross(spin, np.cross(spin, arm))
        tensor = frames[index][:3, :3] @ body.inertia_kgm2 @ frames[index][:3, :3].T
        force = body.mass_kg * (centre + np.array([0.0, 0.0, GRAVITY_M_S2]))
        moment = tensor @ spin_rate + np.cross(spin, tensor @ spin)
        torques += linear[index].T @ force + angular[index].T @ moment
    return torques


def newton_euler(bodies: tuple[Body, ...], places: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """Return ours: the torques and the mass matrix."""
    count = len(bodies)
    tree = [value for body in bodies for value in body.numbers()]
    motion = [0.0] * (count * MOTION_FIELDS)
    torques, column, masses = [0.0] * count, [0.0] * count, [0.0] * count**2
    mechanics.take_pose(tree, motion, places.tolist(), count)
    mechanics.mass_matrix(tree, motion, [0.0] * count, [0.0] * count, column, masses, count)
    mechanics.inverse_dynamics(tree, motion, rates.tolist(), accelerations.tolist(), GRAVITY_M_S2, torques, count)
    return np.array(torques), np.array(masses).reshape(count, count)


@pytest.mark.parametrize("seed", range(8))
def test_torques_and_masses_are_those_of_lagrange(seed: int) -> None:
    bodies, random = random_tree(seed), np.random.default_rng(100 + seed)
    places, rates, accelerations = random.uniform(-2, 2, (3, 6))
    torques, masses = newton_euler(bodies, places, rates, accelerations)
    np.testing.assert_allclose(masses, masses_of(bodies, places), rtol=1e-12, atol=1e-12)
    still, _ = newton_euler(bodies, places, np.zeros(6), np.zeros(6))
    np.testing.assert_allclose(still, weights_of(bodies, places), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(torques, lagrange(bodies, places, rates, accelerations), rtol=1e-8, atol=1e-8)
    forces = by_virtual_power(bodies, places, rates, accelerations)
    np.testing.assert_allclose(torques, forces, rtol=1e-12, atol=1e-12 * np.abs(forces).max())


def test_a_matrix_times_its_inverse_is_one() -> None:
    _, masses = newton_euler(random_tree(3), np.zeros(6), np.zeros(6), np.zeros(6))
    inverse = [0.0] * 36
    mechanics.invert(masses.ravel().tolist(), inverse, 6)
    np.testing.assert_allclose(np.array(inverse).reshape(6, 6) @ masses, np.eye(6), atol=1e-11)


def driven(backend: RotorBackend, milliseconds: int) -> bytes:
    """Return the samples of six coupled axes, of which one is elastic, as bytes."""
    motor = CATALOGUE["23HS22-2804S"]
    drives = [Drive(motor, 0.6, friction_nm=0.02, efficiency=0.9, brake_nm=0.2) for _ in range(5)]
    drives.append(Drive(motor, 0.6, stiffness_nm_rad=8.0, damping_nm_s=0.001, lower_rad=-0.2))
    arm = Arm(random_tree(5), np.eye(6) / 20.0, np.zeros(6))
    rotors = Rotors(drives, arm, PowerSupply(24.0, 0.2, 470e-6), [0.0] * 6, backend=backend)
    events = []
    for axis in range(6):
        counts = np.arange(1000 * axis, 72_000 * milliseconds, 5000 + 700 * axis)
        angle = (1 - 2 * (axis % 2)) * np.arange(counts.size) * np.pi / 16
        on = np.where(np.arange(counts.size) < 0.7 * counts.size, 1.0, 0.0)
        fast = np.full(counts.size, 0.25)
        events.append(DriverEvents(counts, angle, 2.0 * on * np.cos(angle), 2.0 * on * np.sin(angle), fast, on))
    rotors.feed(events)
    record = rotors.advance(milliseconds)
    return record.rotor_rad.tobytes() + record.worst_rad.tobytes() + record.torque_nm.tobytes()


def test_plain_python_and_numba_give_the_same_bytes() -> None:
    pytest.importorskip("numba")
    assert driven(python_rotors(), 12) == driven(compiled_rotors(), 12)


def two_links() -> Arm:
    """Return an upright arm of two links behind gears of 1 to 10, whose inertias depend much on the elbow."""
    link = np.diag([0.0, 1e-4, 1e-4])
    elbow = np.eye(4)
    elbow[0, 3] = 0.1
    bodies = (
        Body(BASE, False, np.eye(4), 0.1, np.array([0.05, 0.0, 0.0]), link),
        Body(0, False, elbow, 0.1, np.array([0.05, 0.0, 0.0]), link),
    )
    return Arm(bodies, np.eye(2) / 10.0, np.zeros(2))


def refreshed_each_step() -> RotorBackend:
    """Return the plain functions, with masses that are refreshed at every step of 10 us instead of every ms."""

    def run(
        arm: ArmArrays, joints: JointArrays, masses: mechanics.MassArrays, rotors: RotorArrays, events: EventArrays,
        kept: list[float], first_step: int, steps: int, first_counts: float,
    ) -> None:  # fmt: skip
        for step in range(steps):
            follow(arm, rotors.state, joints)
            mechanics.refresh(arm, joints, masses, rotors)
            advance_rotors(rotors, events, first_step + step, 1, first_counts + step * DT_COUNTS)
            if (first_step + step + 1) % REFRESH_STEPS == 0:
                keep(rotors.state, kept, step // REFRESH_STEPS, arm.axis_count)

    return replace(python_rotors(), run=run)


@pytest.mark.slow
def test_masses_refreshed_each_ms_are_fresh_enough() -> None:
    """Two links fling each other, the elbow through 40 degrees in 80 ms: load angles within 0.5 degrees."""
    motor, milliseconds = CATALOGUE["17HS19-2004S1"], 80

    def worst_deg(backend: RotorBackend) -> Array:
        rotors = Rotors([Drive(motor, 0.6)] * 2, two_links(), PowerSupply(24.0), [0.0, 0.0], backend=backend)
        counts = np.arange(0, 72_000 * milliseconds, 3600)
        part = counts / (72_000 * milliseconds)
        events = []
        for turns in (-0.6, 1.1):
            angle = 2.0 * np.pi * 50 * turns * (part - np.sin(2.0 * np.pi * part) / (2.0 * np.pi))
            one = np.ones(counts.size)
            events.append(DriverEvents(counts, angle, 2.0 * np.cos(angle), 2.0 * np.sin(angle), one, one))
        rotors.feed(events)
        record = rotors.advance(milliseconds)
        assert not record.lost_full_steps.any()
        return np.asarray(np.rad2deg(np.abs(record.worst_rad).max(axis=0)))

    each_ms, each_step = worst_deg(python_rotors()), worst_deg(refreshed_each_step())
    assert each_ms.min() > 20.0
    np.testing.assert_allclose(each_ms, each_step, atol=0.5)
    assert np.abs(each_ms - each_step).max() > 1e-6
