"""The rotors of an arm's stepper motors: currents, torques and turning, in steps of 10 us.

Two-phase hybrid stepper (MathWorks, Simscape Electrical, block "Stepper Motor", averaged model), SI units, phi the
rotor's electrical angle and w its speed:

    eA = -Km w sin phi        eB = Km w cos phi        L di/dt = v - R i - e
    T = Km (iB cos phi - iA sin phi) - drag w - Td sin 4 phi

The chopper is averaged: in each step v drives the phase's current to its reference, as far as the supply allows. In the
reference's direction that is the whole supply, against it the fraction of fast decay (TB6560AHQ datasheet, page 10);
without decay the current falls through the bridge alone.

Every motor turns a coordinate of the mechanism. A stiff one is the coordinate. An elastic one, a belt's, is joined to
it by a spring, two masses for a joint. The mechanism's mass matrix and bias force, both in the rotors' coordinates, are
held for the steps of one call and refreshed by the caller (`mechanics`).

Currents take the exact exponential of a step with constant v and e, speeds and angles the semi-implicit Euler step.
Coulomb friction, brakes and end stops are impulses that stop a coordinate or are used up (`rub`).

Functions are plain: on lists they are the reference, compiled by numba on float64 arrays they give the same bytes, so
sine and cosine are polynomials of our own: a library's differ in the last bit between the two. The storage is
`RotorArrays` and `EventArrays`.
"""

from typing import NamedTuple

from steptwin.controller.motion.kernel import kernel_function
from steptwin.emulator.drivers.power_supply import DRAWN_J, VOLTS, draw

S3, S5, S7, S9, S11, S13 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800
"""Coefficients of the sine's series."""
C2, C4, C6, C8, C10, C12, C14 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800, 1 / 479001600, -1 / 87178291200
"""Coefficients of the cosine's series."""
QUARTERS_PER_RAD = 0.6366197723675814
"""Quarter turns in a rad."""
QUARTER_HIGH, QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11
"""A quarter turn in two parts: a multiple of the first, of 33 bits, is exact."""


@kernel_function
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return sine and cosine of an angle of up to 1e7 rad, within 1e-13: Taylor's polynomials over a quarter turn."""
    quarters = int(angle * QUARTERS_PER_RAD + (0.5 if angle >= 0.0 else -0.5))
    x = (angle - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    y = x * x
    s = x + x * y * (S3 + y * (S5 + y * (S7 + y * (S9 + y * (S11 + y * S13)))))
    c = 1.0 + y * (C2 + y * (C4 + y * (C6 + y * (C8 + y * (C10 + y * (C12 + y * C14))))))
    quadrant = quarters & 3
    if quadrant == 0:
        return s, c
    if quadrant == 1:
        return c, -s
    if quadrant == 2:
        return -s, -c
    return -c, s


DT_S = 1e-5
"""One step of integration: 1.6 degrees electrical from a reference of 0.5 us at worst, without a slip."""
DT_COUNTS = 720
"""The same in counts of the 72 MHz timer."""

PI = 3.141592653589793

SWEEPS = 2
"""Passes over the coordinates to find the impulses of friction; each step begins with the last step's impulses."""
UNLIMITED = 1e9
"""Largest impulse of an end stop in Nm s: practically unlimited."""

# --- parameters of an axis

TEETH = 0
"""Electrical turns in one turn."""
KM = 1
"""Torque constant in Nm/A."""
DRAG = 2
"""Drag of iron and bearings in Nm s."""
DETENT = 3
"""Detent torque in Nm."""
RESISTANCE = 4
"""Resistance of a phase with its bridge and sense resistor in ohm."""
DECAY = 5
"""exp(-R dt / L)."""
MEAN = 6
"""(1 - exp(-R dt / L)) L / (R dt): the part of a decaying current that is its mean over a step."""
WINDING_OHM = 7
"""Resistance of the winding alone, which heats the motor."""
FRICTION = 8
"""Coulomb friction at the coordinate in Nm of the rotor."""
BRAKE = 9
"""Torque of the brake, which holds while the driver's outputs are off, in Nm of the rotor."""
ELASTIC = 10
"""1 if a spring joins rotor and coordinate, else 0."""
STIFFNESS = 11
"""Of the spring, in Nm/rad at the rotor."""
DAMPING = 12
"""Of the spring, in Nm s/rad at the rotor."""
INERTIA = 13
"""Rotor inertia in kg m^2; used where a spring separates rotor and coordinate."""
LOWER = 14
"""Lower end stop of the coordinate in rad of the rotor."""
UPPER = 15
"""Upper end stop, likewise."""
HEATING = 16
"""dt / heat capacity, in K/W."""
COOLING = 17
"""dt / thermal time constant."""
SLIDING = 18
"""Friction of the gear for each Nm that it carries: 1 / efficiency - 1."""
GAIN = 19
"""R / (1 - exp(-R dt / L)): the voltage for each ampere by which a current must change in a step."""
CONDUCTANCE = 20
"""1 / R."""
MOUNTING = 21
"""Electrical angle of the rotor where its coordinate is 0, in rad."""
AXIS_FIELDS = 22

# --- state of an axis

ANGLE = 0
"""Electrical angle of the rotor in rad."""
SPEED = 1
"""Speed of the rotor in rad/s."""
PLACE = 2
"""The coordinate in rad of the rotor."""
RATE = 3
"""Its speed in rad/s."""
CURRENT_A = 4
CURRENT_B = 5
"""Currents in A."""
FIELD = 6
"""Electrical angle to which the driver turns the field, in rad, counted through."""
WANTED_A = 7
WANTED_B = 8
"""Chopper references of the currents in A."""
FAST = 9
"""Fraction of fast decay."""
ON = 10
"""1 while the outputs are on, else 0."""
WORST = 11
"""Load angle with the largest magnitude since the caller last cleared it, in electrical rad, with sign."""
TURN = 12
"""Electrical turns between rotor and field; each is four full steps lost."""
SLIP_STEP = 13
"""Step of the first slip, -1 before it."""
HEAT = 14
"""Temperature of the windings above ambient in K."""
TORQUE = 15
"""Torque of the motor in the last step in Nm."""
IN_J = 16
"""Energy that the bridges have put into the phases."""
COPPER_J = 17
"""Energy lost in resistances."""
DRAG_J = 18
"""Energy lost in iron and bearings by drag and by damping of the spring."""
RUBBED_J = 19
"""Energy lost to Coulomb friction, brake and end stops."""
LOADED_J = 20
"""Energy given to the bias force: weight and velocity terms of the arm."""
IMPULSE = 21
"""Impulse of friction, brake and end stop in the last step in Nm s."""
STATE_FIELDS = 22

# --- events

AT_COUNTS, EVENT_FIELD, EVENT_A, EVENT_B, EVENT_FAST, EVENT_ON = range(6)
EVENT_FIELDS = 6


class RotorArrays(NamedTuple):
    """All rotors as the functions store them.

    Attributes:
        axes: AXIS_FIELDS numbers for each axis: parameters that do not change.
        All rotors in the storage of the compiled functions.
        inverse: axes x axes, the inverse of the mass matrix in rotors' coordinates.
        bias: one torque for each axis.
        forces: one number for each axis; working storage.
        supply: SUPPLY_FIELDS numbers of the supply that all share (`power_supply`).
    """

    axes: list[float]
    state: list[float]
    inverse: list[float]
    bias: list[float]
    forces: list[float]
    supply: list[float]


class EventArrays(NamedTuple):
    """The changes of the axes' drivers.

    Attributes:
        rows: EVENT_FIELDS numbers for each change, sorted by time; axis after axis.
        ends: for each axis the index behind its last event.
        cursors: for each axis the index of its next event.
    """

    rows: list[float]
    ends: list[int]
    cursors: list[int]


@kernel_function
def driven(wanted_v: float, wanted_a: float, current_a: float, supply_v: float, fast: float) -> float:
    """Return the chopper's voltage at a phase: the full supply towards the wanted current, a part of it against."""
    ahead = wanted_a if wanted_a != 0.0 else current_a
    upper, lower = (supply_v, -fast * supply_v) if ahead >= 0.0 else (fast * supply_v, -supply_v)
    if wanted_v > upper:
        return upper
    return lower if wanted_v < lower else wanted_v


@kernel_function
def freewheeled(wanted_v: float, emf_v: float, current_a: float, supply_v: float) -> float:
    """Return the voltage at a phase with its bridge off: diodes oppose the current by the supply until it ends."""
    if current_a > 0.0 and wanted_v < -supply_v:
        return -supply_v
    if current_a < 0.0 and wanted_v > supply_v:
        return supply_v
    # The current ends within this step, or has ended; only the back-EMF is left, which drives no current.
    return wanted_v if current_a != 0.0 else emf_v


@kernel_function
def advance_phase(
    axes: list[float], state: list[float], supply: list[float], p: int, x: int, phase: int, emf_v: float
) -> float:
    """Advance one phase's current by a step; return its mean over the step."""
    supply_v = supply[VOLTS]
    current, wanted = state[x + CURRENT_A + phase], state[x + WANTED_A + phase]
    resistance, decay = axes[p + RESISTANCE], axes[p + DECAY]
    if state[x + ON] > 0.0:
        wanted_v = (wanted - decay * current) * axes[p + GAIN] + emf_v
        volts = driven(wanted_v, wanted, current, supply_v, state[x + FAST])
    else:
        wanted_v = emf_v - decay * current * axes[p + GAIN]
        volts = freewheeled(wanted_v, emf_v, current, supply_v)
    final = (volts - emf_v) * axes[p + CONDUCTANCE]
    apart = current - final
    mean = final + apart * axes[p + MEAN]
    state[x + CURRENT_A + phase] = final + apart * decay
    # The mean of the square over the step: exp(-t) has the mean MEAN, exp(-2t) has MEAN (1 + decay) / 2.
    square = final * final + apart * axes[p + MEAN] * (2.0 * final + apart * 0.5 * (1.0 + decay))
    state[x + IN_J] += volts * mean * DT_S
    supply[DRAWN_J] += volts * mean * DT_S
    state[x + COPPER_J] += resistance * square * DT_S
    state[x + HEAT] += axes[p + HEATING] * axes[p + WINDING_OHM] * square
    return mean


@kernel_function
def take_events(
    state: list[float], events: list[float], ends: list[int], cursors: list[int], axis: int, now: float
) -> None:
    """Apply an axis' driver events up to an instant in counts."""
    x = axis * STATE_FIELDS
    while cursors[axis] < ends[axis] and events[cursors[axis] * EVENT_FIELDS + AT_COUNTS] <= now:
        e = cursors[axis] * EVENT_FIELDS
        state[x + FIELD], state[x + WANTED_A] = events[e + EVENT_FIELD], events[e + EVENT_A]
        state[x + WANTED_B], state[x + FAST] = events[e + EVENT_B], events[e + EVENT_FAST]
        state[x + ON] = events[e + EVENT_ON]
        cursors[axis] += 1


@kernel_function
def motor_torque(axes: list[float], state: list[float], supply: list[float], p: int, x: int) -> float:
    """Advance an axis' currents by a step; return the motor's torque, without its drag."""
    s, c = sine_cosine(state[x + ANGLE])
    km, speed = axes[p + KM], state[x + SPEED]
    mean_a = advance_phase(axes, state, supply, p, x, 0, -km * speed * s)
    mean_b = advance_phase(axes, state, supply, p, x, 1, km * speed * c)
    state[x + HEAT] -= axes[p + COOLING] * state[x + HEAT]
    double_sine, double_cosine = 2.0 * s * c, c * c - s * s
    torque = km * (mean_b * c - mean_a * s)
    state[x + TORQUE] = torque
    return torque - axes[p + DETENT] * 2.0 * double_sine * double_cosine


@kernel_function
def give_impulse(state: list[float], inverse: list[float], count: int, axis: int, impulse: float) -> None:
    """Give a coordinate an impulse in Nm s, which changes the rates of all."""
    row = axis * count
    for other in range(count):
        state[other * STATE_FIELDS + RATE] += inverse[row + other] * impulse


@kernel_function
def friction_limit(axes: list[float], state: list[float], bias: list[float], axis: int) -> float:
    """Return the largest impulse of friction and brake in a step."""
    p = axis * AXIS_FIELDS
    carried = bias[axis] if bias[axis] >= 0.0 else -bias[axis]
    friction = axes[p + FRICTION] + axes[p + SLIDING] * carried
    if state[axis * STATE_FIELDS + ON] == 0.0:
        friction += axes[p + BRAKE]
    return friction * DT_S


@kernel_function
def rub(
    axes: list[float], state: list[float], inverse: list[float], bias: list[float], forces: list[float], count: int
) -> None:
    """Apply friction, brakes and end stops for one step.

    Each coordinate's impulse stops it or reaches its limit. Coordinates are coupled, so projected Gauss-Seidel finds
    all impulses together, from those of the step before (M. Catto, "Iterative dynamics with temporal coherence", 2005).
    """
    for axis in range(count):
        forces[axis] = state[axis * STATE_FIELDS + RATE]
    for axis in range(count):
        give_impulse(state, inverse, count, axis, state[axis * STATE_FIELDS + IMPULSE])
    for _ in range(SWEEPS):
        settled = True
        for axis in range(count):
            x = axis * STATE_FIELDS
            limit = friction_limit(axes, state, bias, axis)
            wanted = state[x + IMPULSE] - state[x + RATE] / inverse[axis * count + axis]
            if state[x + PLACE] >= axes[axis * AXIS_FIELDS + UPPER]:
                lower, upper = -UNLIMITED, limit
            elif state[x + PLACE] <= axes[axis * AXIS_FIELDS + LOWER]:
                lower, upper = -limit, UNLIMITED
            else:
                lower, upper = -limit, limit
            impulse = lower if wanted < lower else (upper if wanted > upper else wanted)
            if impulse != state[x + IMPULSE]:
                give_impulse(state, inverse, count, axis, impulse - state[x + IMPULSE])
                state[x + IMPULSE] = impulse
                settled = False
        if settled:
            break
    for axis in range(count):
        x = axis * STATE_FIELDS
        state[x + RUBBED_J] -= state[x + IMPULSE] * (forces[axis] + state[x + RATE]) / 2.0


@kernel_function
def turn(axes: list[float], state: list[float], axis: int, step: int) -> None:
    """Turn a rotor by its speed; update its load angle, and note a slip at half a turn from the field."""
    p, x = axis * AXIS_FIELDS, axis * STATE_FIELDS
    state[x + PLACE] += DT_S * state[x + RATE]
    if axes[p + ELASTIC] == 0.0:
        state[x + SPEED] = state[x + RATE]
    state[x + ANGLE] += DT_S * axes[p + TEETH] * state[x + SPEED]
    if state[x + ON] == 0.0:
        return
    lag = state[x + FIELD] - state[x + ANGLE] - 2.0 * PI * state[x + TURN]
    while lag > PI or lag < -PI:
        by = 1.0 if lag > 0.0 else -1.0
        state[x + TURN] += by
        lag -= 2.0 * PI * by
        if state[x + SLIP_STEP] < 0.0:
            state[x + SLIP_STEP] = float(step)
    if lag * lag > state[x + WORST] * state[x + WORST]:
        state[x + WORST] = lag


@kernel_function
def push_coordinates(state: list[float], inverse: list[float], forces: list[float], count: int) -> None:
    """Accelerate the coordinates by the forces of one step."""
    for axis in range(count):
        change = 0.0
        for other in range(count):
            change += inverse[axis * count + other] * forces[other]
        state[axis * STATE_FIELDS + RATE] += DT_S * change


@kernel_function
def advance_rotors(rotors: RotorArrays, events: EventArrays, first_step: int, steps: int, first_counts: float) -> None:
    """Advance all axes by `steps` steps; `first_counts` is the start of the first one."""
    axes, state, inverse, bias = rotors.axes, rotors.state, rotors.inverse, rotors.bias
    forces, supply = rotors.forces, rotors.supply
    rows, ends, cursors = events.rows, events.ends, events.cursors
    count = len(ends)
    for step in range(first_step, first_step + steps):
        now = first_counts + (step - first_step) * DT_COUNTS
        for axis in range(count):
            p, x = axis * AXIS_FIELDS, axis * STATE_FIELDS
            take_events(state, rows, ends, cursors, axis, now)
            torque = motor_torque(axes, state, supply, p, x)
            speed = state[x + SPEED]
            if axes[p + ELASTIC] > 0.0:
                twist = (state[x + ANGLE] - axes[p + MOUNTING]) / axes[p + TEETH] - state[x + PLACE]
                slide = speed - state[x + RATE]
                carried = axes[p + STIFFNESS] * twist + axes[p + DAMPING] * slide
                state[x + SPEED] += DT_S * (torque - axes[p + DRAG] * speed - carried) / axes[p + INERTIA]
                state[x + DRAG_J] += (axes[p + DRAG] * speed * speed + axes[p + DAMPING] * slide * slide) * DT_S
                forces[axis] = carried - bias[axis]
            else:
                state[x + DRAG_J] += axes[p + DRAG] * speed * speed * DT_S
                forces[axis] = torque - axes[p + DRAG] * speed - bias[axis]
            state[x + LOADED_J] += bias[axis] * state[x + RATE] * DT_S
        draw(supply, DT_S)
        push_coordinates(state, inverse, forces, count)
        rub(axes, state, inverse, bias, forces, count)
        for axis in range(count):
            turn(axes, state, axis, step)
