"""A robot's machine as the emulator has it: its board, its switches, where its motors stand, what its drivers saw."""

from collections.abc import Iterator, Sequence

import numpy as np

from steptwin.controller.pins import Pin, PinChange
from steptwin.emulator.board import AxisTrace, BoardConfig
from steptwin.emulator.switches import Switch
from steptwin.host.robots.board_settings import ActiveEdge
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.drivers import driver_profile, fitted_module, phases_evidence, violations_evidence
from steptwin.host.verify import AxisEvidence, LevelEdges
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.objects import UNITS_PER_FULL_STEP


def board_config(robot: Robot, joints: Sequence[float], driver_profile_name: str | None = None) -> BoardConfig:
    """The board that drives a robot, an axis for each joint, in a machine that stands at `joints`, mm and degrees.

    By a name it has other drivers than the robot's file says; the file's settings of drivers are for its own alone.

    Raises:
        InputError: there are no such drivers, or they cannot be set as the robot needs them.
    """
    (config,) = board_configs(robot, joints, [len(robot.joints)], driver_profile_name)
    return config


def board_configs(
    robot: Robot, joints: Sequence[float], axes_per_board: Sequence[int], driver_profile_name: str | None = None
) -> list[BoardConfig]:
    """The same for several boards on one bus, each with so many axes; node ids go on from board to board."""
    if sum(axes_per_board) != len(robot.joints):
        raise ValueError(f"{axes_per_board} are not the {len(robot.joints)} axes of the robot")
    start_steps = standing_steps(robot, joints)
    profile = driver_profile(robot.board, driver_profile_name)
    modules = tuple(fitted_module(robot.board, profile, joint.transmission.microsteps) for joint in robot.joints)
    configs: list[BoardConfig] = []
    for axes in axes_per_board:
        first = sum(config.axis_count for config in configs)
        configs.append(
            BoardConfig(
                axis_count=axes,
                osc_pf=(profile.osc_pf,) * axes,
                first_node_id=FIRST_NODE_ID + first,
                switches=tuple(_switches(robot.joints[first : first + axes])),
                start_steps=tuple(start_steps[first : first + axes]),
                modules=modules[first : first + axes],
            )
        )
    return configs


def standing_steps(robot: Robot, joints: Sequence[float]) -> list[int]:
    """The steps at which a machine stands, from the joints' zeros; `joints` in mm and degrees."""
    return [_steps_at(joint, position) for joint, position in zip(robot.joints, joints, strict=True)]


def _steps_at(joint: Joint, position: float) -> int:
    """The step at which a joint stands: rounded to a wire unit, then to a step, as the firmware's preset does it.

    Rounded at once, a position just below half a step could come out one step below the firmware's counter.
    """
    return (joint.to_units(position) * joint.transmission.microsteps + UNITS_PER_FULL_STEP // 2) // UNITS_PER_FULL_STEP


def _switches(joints: Sequence[Joint]) -> Iterator[Switch]:
    """The switches of a board's joints; the limit switches are closed to the ends of travel."""
    for axis, joint in enumerate(joints):
        places = joint.switches
        if places.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_steps=_steps_at(joint, places.negative_limit))
        if places.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_steps=_steps_at(joint, places.positive_limit))
        first, last = (None if end is None else _steps_at(joint, end) for end in (places.home_from, places.home_to))
        if first is not None or last is not None:
            yield Switch(axis, DigitalInput.HOME, first, last)


def axis_evidence(
    name: str, start_steps: int, trace: AxisTrace, axis: int, changes: Sequence[PinChange]
) -> AxisEvidence:
    """What happened at one axis' driver, in the verifier's words; of the pin changes those of this axis count."""
    return AxisEvidence(
        name=name,
        start_steps=start_steps,
        clk_rise_counts=trace.clk_rise_counts,
        clk_fall_counts=trace.clk_fall_counts,
        active_edge=ActiveEdge(trace.active_edge),
        dir_edge_counts=trace.dir_counts,
        dir_levels=trace.dir_levels,
        step_counts=trace.step_counts,
        step_signs=trace.step_signs,
        violations=violations_evidence(trace.violations),
        phases=phases_evidence(trace.outputs),
        pins=_level_edges(axis, changes),
    )


def _level_edges(axis: int, changes: Sequence[PinChange]) -> dict[str, LevelEdges]:
    """One axis' pins that the firmware holds at a level, by name."""
    in_order = sorted(changes, key=lambda change: change.counts)
    edges = {pin: [change for change in in_order if (change.axis, change.pin) == (axis, pin)] for pin in Pin}
    return {
        pin.value.lower(): LevelEdges(
            np.array([change.counts for change in own], np.int64), np.array([change.level for change in own], np.int8)
        )
        for pin, own in edges.items()
    }
