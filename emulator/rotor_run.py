"""Turn rotors ms after ms: refresh the arm's masses, advance the rotors, keep their state."""

from steptwin.controller.kernel import TICKS_PER_MS, kernel_function
from steptwin.emulator.following import follow
from steptwin.emulator.mechanics import refresh
from steptwin.emulator.rotor_kernel import DT_COUNTS, STATE_FIELDS, WORST, advance_rotors

REFRESH_STEPS = 100
"""Steps of integration, 1 ms together, for which the arm's mass matrix holds: the load angle differs by 0.1 degrees."""
TICK_STEPS = REFRESH_STEPS // TICKS_PER_MS
"""Steps of integration in a servo tick."""


@kernel_function
def keep(state: list[float], kept: list[float], row: int, axis_count: int) -> None:
    """Copy the state into a row of `kept`, and begin the next greatest load angle."""
    size = axis_count * STATE_FIELDS
    for field in range(size):
        kept[row * size + field] = state[field]
    for axis in range(axis_count):
        state[axis * STATE_FIELDS + WORST] = 0.0


@kernel_function
def run_rotors(
    axes: list[float], state: list[float], events: list[float], ends: list[int], cursors: list[int],
    bodies: list[float], motion: list[float], pair: list[float], slopes: list[float], offsets: list[float],
    places: list[float], rates: list[float], drifts: list[float],
    zeros: list[float], unit: list[float], torques: list[float], masses: list[float], matrix: list[float],
    inverse: list[float], bias: list[float], forces: list[float], supply: list[float], kept: list[float],
    count: int, axis_count: int, first_step: int, steps: int, first_counts: float, gravity: float,
) -> None:  # fmt: skip
    """Turn the rotors for some steps; at the end of each ms among them keep the state.

    Masses are refreshed at the beginning of each ms, so the result does not depend on how time is divided into calls.
    For the arguments see `advance_rotors`, `refresh` and `follow`.
    """
    done = row = 0
    while done < steps:
        into = (first_step + done) % REFRESH_STEPS
        if into == 0:
            follow(pair, slopes, offsets, state, places, rates, drifts, count, axis_count)
            refresh(
                bodies, motion, places, rates, drifts, slopes, axes, zeros, unit, torques, masses, matrix, inverse,
                bias, count, axis_count, gravity,
            )  # fmt: skip
        part = min(REFRESH_STEPS - into, steps - done)
        advance_rotors(
            axes, state, inverse, bias, events, ends, cursors, forces, supply, axis_count, first_step + done, part,
            first_counts + done * DT_COUNTS,
        )  # fmt: skip
        done += part
        if into + part == REFRESH_STEPS:
            keep(state, kept, row, axis_count)
            row += 1
