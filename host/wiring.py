"""A robot's machine as the emulator has it: its board, its switches, where its motors stand, what is wired where."""

from collections.abc import Iterable, Iterator, Sequence
from math import floor
from typing import Final

from controller.pins import Pin, PinChange
from emulator.board import AxisTrace, BoardConfig
from emulator.switches import Switch
from host.robot import Joint, Robot
from host.verify import AxisEvidence, OutputChange
from protocol.cia402 import DigitalInput
from protocol.objects import UNITS_PER_FULL_STEP

_OUTPUTS: Final = (Pin.OUT1, Pin.OUT2)


def board_config(robot: Robot, joints: Sequence[float]) -> BoardConfig:
    """The board that drives a robot, an axis for each joint, in a machine that stands at `joints`, mm and degrees."""
    axes = len(robot.joints)
    return BoardConfig(
        axis_count=axes,
        osc_pf=(robot.board.osc_pf,) * axes,
        switches=tuple(_switches(robot)),
        start_steps=tuple(standing_steps(robot, joints)),
    )


def _switches(robot: Robot) -> Iterator[Switch]:
    """The switches of the robot's file; the limit switches are closed to the ends of travel."""
    for axis, joint in enumerate(robot.joints):
        places = joint.switches
        if places.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_steps=_steps_at(joint, places.negative_limit))
        if places.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_steps=_steps_at(joint, places.positive_limit))
        first, last = (None if end is None else _steps_at(joint, end) for end in (places.home_from, places.home_to))
        if first is not None or last is not None:
            yield Switch(axis, DigitalInput.HOME, first, last)


def standing_steps(robot: Robot, joints: Sequence[float]) -> list[int]:
    """The steps at which a machine stands, from the joints' zeros; `joints` in mm and degrees."""
    return [_steps_at(joint, position) for joint, position in zip(robot.joints, joints, strict=True)]


def _steps_at(joint: Joint, position: float) -> int:
    """Rounded to a wire unit, then to a step, as the firmware's preset does it.

    Rounded at once, a position just below half a step could come out one step below the firmware's counter.
    """
    units = floor(position * joint.transmission.wire_units_per_unit + 0.5)
    return (units * joint.transmission.microsteps + UNITS_PER_FULL_STEP // 2) // UNITS_PER_FULL_STEP


def axis_evidence(name: str, start_steps: int, trace: AxisTrace) -> AxisEvidence:
    """What happened at an axis' driver, in the verifier's words."""
    return AxisEvidence(
        name=name,
        start_steps=start_steps,
        clk_rise_counts=trace.clk_rise_counts,
        clk_fall_counts=trace.clk_fall_counts,
        dir_edge_counts=trace.dir_counts,
        dir_levels=trace.dir_levels,
        step_counts=trace.step_counts,
        step_signs=trace.step_signs,
        violations=len(trace.violations.counts),
    )


def output_changes(robot: Robot, changes: Iterable[PinChange]) -> tuple[OutputChange, ...]:
    """By the names in the robot's file; an output that nothing is wired to has none and is left out."""
    wired = wired_outputs(robot)
    return tuple(
        OutputChange(wired[change.axis, change.pin], change.counts, change.level)
        for change in changes
        if (change.axis, change.pin) in wired
    )


def wired_outputs(robot: Robot) -> dict[tuple[int, Pin], str]:
    """Which output of the robot is at an axis' pin."""
    axes = {name: axis for axis, name in enumerate(robot.joint_names)}
    return {(axes[output.joint], _OUTPUTS[output.out - 1]): name for name, output in robot.outputs.items()}
