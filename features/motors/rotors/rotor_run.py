"""Turn rotors ms after ms: refresh the arm's masses, advance the rotors, keep their state."""

from steptwin.controller.motion.kernel import TICKS_PER_MS, kernel_function
from steptwin.features.motors.rotors.following import ArmArrays, JointArrays, follow
from steptwin.features.motors.rotors.mechanics import MassArrays, refresh
from steptwin.features.motors.rotors.rotor_kernel import (
    DT_COUNTS,
    STATE_FIELDS,
    WORST,
    EventArrays,
    RotorArrays,
    advance_rotors,
)

REFRESH_STEPS = 100
"""Steps of integration, 1 ms together, between two updates of the masses; the load angle differs by 0.1 degrees."""
TICK_STEPS = REFRESH_STEPS // TICKS_PER_MS
"""Steps of integration in a servo tick."""


@kernel_function
def keep(state: list[float], kept: list[float], row: int, axis_count: int) -> None:
    """Copy the state into a row of `kept`, and reset the greatest load angle."""
    size = axis_count * STATE_FIELDS
    for field in range(size):
        kept[row * size + field] = state[field]
    for axis in range(axis_count):
        state[axis * STATE_FIELDS + WORST] = 0.0


@kernel_function
def run_rotors(
    arm: ArmArrays, joints: JointArrays, masses: MassArrays, rotors: RotorArrays, events: EventArrays,
    kept: list[float], first_step: int, steps: int, first_counts: float,
) -> None:  # fmt: skip
    """Turn the rotors for some steps; keep the state at the end of each ms.

    Masses are updated at the beginning of each ms, so the division of time into calls does not change the result.
    """
    done = row = 0
    while done < steps:
        into = (first_step + done) % REFRESH_STEPS
        if into == 0:
            follow(arm, rotors.state, joints)
            refresh(arm, joints, masses, rotors)
        part = min(REFRESH_STEPS - into, steps - done)
        advance_rotors(rotors, events, first_step + done, part, first_counts + done * DT_COUNTS)
        done += part
        if into + part == REFRESH_STEPS:
            keep(rotors.state, kept, row, arm.axis_count)
            row += 1
