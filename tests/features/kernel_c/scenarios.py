"""Random scenarios for the kernel, as data: ramps of the group, late steps, refusals, values at the limits of i32."""

from dataclasses import dataclass
from random import Random

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from tests.controller.motion.kernel_rig import KernelRig, Timing

Segment = tuple[int, int, int]
"""Displacement in units, end velocity in 1/64 unit per ms, duration in ticks."""


@dataclass(frozen=True)
class Phase:
    """What happens at one instant, and the ticks that are run after it."""

    segments: tuple[tuple[Segment, ...], ...]
    ramp: tuple[int, int] | None
    ticks: int


@dataclass(frozen=True)
class Scenario:
    """An axis' or some axes' configuration, and what they are told."""

    axes: int
    microsteps: int
    timing: Timing
    rate_limit_q16_per_ms: int
    in_group: tuple[int, ...]
    first_tick: int
    inverted: int
    stops_late: bool
    """Whether an axis whose step is late is stopped, as the board does, or goes on."""
    phases: tuple[Phase, ...]


def scenario(seed: int) -> Scenario:
    """Draw a scenario; one in eight has values at the limits of i32."""
    draw = Random(seed)
    extreme = seed % 8 == 0
    axes, microsteps = draw.randint(1, 3), draw.choice((1, 2, 8, 16, 125, 256))
    longest = draw.choice((1, 300, 2500))
    timing = Timing(*(draw.randint(1, longest) for _ in range(2)), *(draw.randint(0, 4 * longest) for _ in range(2)))
    rate = k.I32_MAX if extreme else draw.choice((15, 60, 200)) * k.STEP_Q16
    least_ticks = draw.choice((1, 2))
    phases = tuple(
        _phase(draw, axes, microsteps, rate >> 16, least_ticks, extreme=extreme) for _ in range(draw.randint(1, 3))
    )
    in_group = tuple(draw.randint(0, 1) for _ in range(axes))
    first_tick = draw.choice((0, 0, draw.randint(0, 1 << 40)))
    inverted, stops_late = draw.randint(0, 1), extreme or draw.random() < 0.5
    return Scenario(axes, microsteps, timing, rate, in_group, first_tick, inverted, stops_late, phases)


def _phase(draw: Random, axes: int, microsteps: int, steps_per_ms: int, least_ticks: int, *, extreme: bool) -> Phase:
    """Draw a phase; only where no segment is shorter than two ticks the group runs faster than at full rate."""
    largest = k.I32_MAX // 3 // (4 * microsteps)

    def segment() -> Segment:
        if extreme:
            displacement = draw.choice((0, largest, -largest, largest + 1, draw.randint(-largest, largest), k.I32_MAX))
            velocity = draw.choice((0, draw.randint(-(1 << 23), 1 << 23), k.I32_MAX, -k.I32_MAX - 1))
            return displacement, velocity, draw.choice((0, least_ticks, 1020, 1021, draw.randint(least_ticks, 1020)))
        ticks = draw.randint(least_ticks, 60)
        units_per_ms = steps_per_ms * 16_384 // microsteps
        speed = draw.choice((units_per_ms // 200, units_per_ms // 4, units_per_ms * 2 // 5))
        velocity = draw.choice((0, 32 * draw.randint(-speed, speed), 64 * units_per_ms + draw.randint(0, 1)))
        return draw.randint(-speed, speed) * ticks // 4, velocity, ticks

    segments = tuple(tuple(segment() for _ in range(draw.choice((1, 4, 66 if extreme else 8)))) for _ in range(axes))
    highest = k.FULL_RATE_Q16 if least_ticks < 2 else k.HIGHEST_RATE_Q16
    ramp = draw.choice((None, (draw.randint(0, highest), draw.randint(0, 40)), (0, 10), (highest, 20)))
    return Phase(segments, ramp, draw.randint(1, 40))


def play(kernel: Kernel, told: Scenario, ticks_a_call: int) -> tuple[object, ...]:
    """Return everything that a kernel answers and places, called for some ticks at a time."""
    edges = 1 << 18 if told.rate_limit_q16_per_ms == k.I32_MAX else 1 << 13
    rig = KernelRig(kernel, told.axes, told.microsteps, told.timing, told.rate_limit_q16_per_ms, edges)
    rig.tick = told.first_tick
    rig.group[k.RATE_TO_Q16] = k.FULL_RATE_Q16
    answers: list[object] = []
    for axis in range(told.axes):
        rig.set(k.DIR_INVERTED, told.inverted, axis)
    for phase in told.phases:
        for axis, segments in enumerate(phase.segments):
            answers += [rig.push_ticks(*segment, axis) for segment in segments]
            if not rig.get(k.RUNNING, axis):
                answers.append(rig.start(axis))
                rig.set(k.IN_GROUP, told.in_group[axis], axis)
        if phase.ramp:
            rig.ramp(*phase.ramp)
        answers.append(_run(rig, rig.tick + phase.ticks, ticks_a_call, stops_late=told.stops_late))
        answers += [kernel.demand_rate(rig.axes, axis) for axis in range(told.axes)]
    return (*answers, rig.snapshot())


def _run(rig: KernelRig, until_tick: int, ticks_a_call: int, *, stops_late: bool) -> list[tuple[int, int, int]]:
    """Advance and return each event with its tick and axis."""
    events = []
    while rig.tick < until_tick:
        before = rig.tick
        assert rig.advance(min(ticks_a_call, until_tick - rig.tick)) > before
        for axis in range(rig.count):
            event = rig.get(k.EVENT, axis)
            if event != k.EVENT_NONE:
                events.append((rig.tick, axis, event))
                rig.set(k.EVENT, k.EVENT_NONE, axis)
            if event == k.EVENT_LATE_STEP and stops_late:
                for field in (k.RUNNING, k.QUEUE_COUNT, k.TAIL_VELOCITY):
                    rig.set(field, 0, axis)
                rig.set(k.TAIL_Q16, rig.get(k.POSITION_Q16, axis), axis)
    return events
