"""`steptwin check my-arm.toml`: check a robot file and print its content."""

from dataclasses import asdict, astuple
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.arguments import CheckedFile
from steptwin.host.cli.output import Columns, print_rows, say, warn
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.findings import Findings

if TYPE_CHECKING:
    from steptwin.host.robots.joint import Joint
    from steptwin.host.robots.robot import Robot


_SMALL_MM: Final = 5.0
"""Reach below which the dimensions are probably in metres."""
_SAMPLES: Final = 2000
"""Number of random joint positions for the tool's error."""
_NARROW_DEG: Final = 6.3
"""Range of a rotary joint, a turn in radians, below which its limits are probably in radians."""

_PIN_V: Final = 3.3
"""High level of a board's pin: the supply of an STM32."""
_PIN_MA: Final = 8.0
"""Current of a pin of an STM32F103 at its logic levels (DS5319, output voltage characteristics)."""


def check_robot(text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a robot file: joints, ranges, steps, highest speeds, and the tool's reach with the slides at home."""
    from steptwin.host.robots import read_robot

    with findings.collecting():
        if robot_name is not None:
            raise InputError(f"is a robot itself: leave {robot_name} out")
    with findings.collecting():
        robot = read_robot(text)
        document = _document(robot)
        return CheckedFile(document, (lambda: _print(robot, document),))
    return CheckedFile()


def _document(robot: "Robot") -> dict[str, Any]:
    from steptwin.host.robots.kinematics import make_kinematics

    return {
        "robot": robot.name,
        "mechanism": robot.kinematics,
        "joints": [_joint_document(joint, robot.board.driver_rate_max_hz) for joint in robot.joints],
        "coupling": _equations(robot),
        **_dh_errors_document(robot),
        **{f"{feature.name}_missed": list(check(robot)) for feature, check in giving("check_robot")},
        **({"inverse": words} if (words := make_kinematics(robot).inverse_words) else {}),
        "reach": _reach(robot),
    }


def _reach(robot: "Robot") -> dict[str, Any] | None:
    """Return the tool's reach, by exact sections or by random joints; None without a tool."""
    from steptwin.host.robots.kinematics import make_kinematics
    from steptwin.host.robots.workspace import has_sections, monte_carlo, scan

    if not make_kinematics(robot).task.width:
        return None
    if not has_sections(robot):
        cloud = monte_carlo(robot, _SAMPLES, seed=1)
        return {"slides": {}, "radius_mm": cloud.radius_mm, "z_mm": cloud.z_mm, "area_mm2": None, "area_at_z_mm": None}
    scanned = scan(robot)
    return {
        "slides": dict(scanned.slides),
        "radius_mm": scanned.plan.radius_mm,
        "z_mm": scanned.profile.z_mm,
        "area_mm2": scanned.plan.area_mm2,
        "area_at_z_mm": scanned.plan.z_mm,
    }


def _dh_errors_document(robot: "Robot") -> dict[str, Any]:
    """Return the errors of the DH parameters, and the tool's deviation by them at home and at random joints."""
    import numpy as np

    from steptwin.host.robots.kinematics.chain import actual_chain, random_joints

    chain = actual_chain(robot)
    if chain is None:
        return {}
    joints = np.vstack([[robot.home], random_joints(robot, _SAMPLES, np.random.default_rng(1))])
    nominal = chain.with_errors(np.zeros_like(chain.errors))
    distances_mm = np.linalg.norm((chain.poses(joints) - nominal.poses(joints))[:, :3], axis=1)
    return {
        "dh_errors": {
            "links": {link: asdict(errors) for link, errors in chain.link_errors.items()},
            "at_home_mm": float(distances_mm[0]),
            "rms_mm": float(np.sqrt(np.mean(distances_mm[1:] ** 2))),
            "max_mm": float(distances_mm.max()),
        }
    }


def _equations(robot: "Robot") -> list[str]:
    """Return the equation of each axis that depends on other joints, as in `axis th2 = th2 + th1`."""
    equations = []
    for axis, row in enumerate(robot.coupling.matrix):
        own = robot.coupling.joint_of(axis)
        others = [joint for joint, element in enumerate(row) if element and joint != own]
        if others or row[own] != 1 or own != axis:
            first = _term(row[own], robot.joint_names[own])
            rest = (
                f" {'-' if row[joint] < 0 else '+'} {_term(abs(row[joint]), robot.joint_names[joint])}"
                for joint in others
            )
            equations.append(f"axis {robot.axis_names[axis]} = {first}{''.join(rest)}")
    return equations


def _term(element: float, joint: str) -> str:
    return joint if element == 1 else f"{element:g} {joint}"


def _units_in_doubt(document: dict[str, Any]) -> list[str]:
    """Return warnings of dimensions that are probably in metres and limits that are probably in radians."""
    warnings = []
    radius_mm = document["reach"] and document["reach"]["radius_mm"]
    if radius_mm is not None and radius_mm[1] < _SMALL_MM:
        told = "are the dimensions in metres? They are read in mm"
        warnings.append(f"kinematics: the tool reaches no further than {radius_mm[1]:.3g} mm: {told}")
    for joint in document["joints"]:
        width = joint["upper"] - joint["lower"]
        if joint["unit"] == "deg" and width < _NARROW_DEG:
            told = "are its limits in radians? They are read in degrees"
            warnings.append(f"joints.{joint['name']}: its range is {width:.3g} deg: {told}")
    return warnings


def _task_too_large(robot: "Robot") -> list[str]:
    """Return a warning if a chain's task has more coordinates than its joints can move: few poses are then in reach."""
    from steptwin.host.robots.kinematics.base import read_geometry
    from steptwin.host.robots.kinematics.serial.chain_geometry import TASKS, ChainGeometry

    if robot.kinematics != "chain":
        return []
    geometry = read_geometry(ChainGeometry, robot)
    task, joints = geometry.tool_task, len(geometry.joints) - len(geometry.held)
    takes = TASKS[task][1]
    if joints >= takes:
        return []
    smaller = [f'task = "{name}"' for name, (_, least) in TASKS.items() if least <= joints]
    ways = f"{smaller[0]} suits them" if smaller else "programs move it by its joints"
    told = f"a {task} has {takes} coordinates, but {joints} joints move the tool"
    return [f"kinematics.task: {told}: most are out of reach; {ways}"]


def _levels_missed(robot: "Robot") -> list[str]:
    """Return a warning if the board's pins do not drive the inputs of the file's drivers."""
    profile = robot.board.profile
    high_v, light_ma = profile.inputs.value
    needs, have = [], []
    if high_v > _PIN_V:
        needs.append(f"{high_v:g} V or more at STEP, DIR and ENABLE as high")
        have.append(f"{_PIN_V:g} V")
    if light_ma > _PIN_MA:
        needs.append(f"{light_ma:g} mA" + ("" if needs else " at STEP, DIR and ENABLE"))
        have.append(f"{_PIN_MA:g} mA")
    if not needs:
        return []
    return [
        f"board.driver_profile: {profile.name} takes {' and '.join(needs)}, and the board's pins have"
        f" {' and '.join(have)}: put buffers of 5 V between, or pull its inputs low from 5 V ({profile.inputs.source})"
    ]


def _joint_document(joint: "Joint", driver_rate_max_hz: float) -> dict[str, Any]:
    return {
        "name": joint.name,
        "unit": joint.unit.value,
        "lower": joint.lower,
        "upper": joint.upper,
        "steps_per_unit": joint.transmission.steps_per_unit,
        "speed_max": joint.speed_max,
        "acceleration_max": joint.acceleration_max,
        "step_rate_max_hz": joint.step_rate_max_hz,
        "step_rate_percent": 100.0 * joint.step_rate_max_hz / driver_rate_max_hz,
        "homing_method": joint.homing.method if joint.homing else None,
    }


def _print(robot: "Robot", document: dict[str, Any]) -> None:
    from steptwin.host.robots.poses import SCARA
    from steptwin.host.robots.poses.base_frame import STATION

    say(f"{robot.name}: {robot.title} ({robot.kinematics})")
    print_rows(_COLUMNS, document["joints"], text_columns=2)
    say(*document["coupling"])
    if robot.base != STATION:
        say(f"the base stands at {SCARA.words(astuple(robot.base))} in the station, the frame of all poses")
    if errors := document.get("dh_errors"):
        say(
            f"DH errors of {len(errors['links'])} links take the tool {errors['at_home_mm']:.3f} mm away at home,"
            f" {errors['rms_mm']:.3f} mm rms and up to {errors['max_mm']:.3f} mm elsewhere"
        )
    for warning in (
        *_units_in_doubt(document),
        *_task_too_large(robot),
        *_levels_missed(robot),
        *(line for feature, _ in giving("check_robot") for line in document[f"{feature.name}_missed"]),
    ):
        warn(warning)
    reach = document["reach"]
    if inverse := document.get("inverse"):
        say(f"poses become joints {inverse}")
    if reach is None:
        say("the machine has no tool: its joints have positions, but no pose")
        return
    at = "".join(f", {name} = {position_mm:g} mm" for name, position_mm in reach["slides"].items())
    if reach["radius_mm"] is None or reach["z_mm"] is None:
        say(f"the tool reaches nothing at the home position's height{at}")
        return
    (nearest_mm, farthest_mm), (lowest_mm, highest_mm) = reach["radius_mm"], reach["z_mm"]
    if reach["area_mm2"] is None:
        heights = f"z = {lowest_mm:z.1f}..{highest_mm:z.1f} mm"
        say(f"the tool reaches r = {nearest_mm:.1f}..{farthest_mm:.1f} mm, {heights}, by {_SAMPLES} random joints")
        return
    say(
        f"the tool reaches r = {nearest_mm:.1f}..{farthest_mm:.1f} mm at z = {reach['area_at_z_mm']:g} mm,"
        f" an area of {reach['area_mm2'] / 100:.0f} cm2; z = {lowest_mm:z.1f}..{highest_mm:z.1f} mm{at}"
    )


_COLUMNS: Final[Columns] = {
    "joint": "{0[name]}",
    "unit": "{0[unit]}",
    "lower": "{0[lower]:g}",
    "upper": "{0[upper]:g}",
    "steps/unit": "{0[steps_per_unit]:.6g}",
    "speed/s": "{0[speed_max]:g}",
    "steps/s": "{0[step_rate_max_hz]:.0f}",
    "of driver": "{0[step_rate_percent]:.0f} %",
    "homing": lambda joint: "none" if joint["homing_method"] is None else str(joint["homing_method"]),
}
