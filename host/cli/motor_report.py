"""What `run --motors` and `motors` say of a robot's motors."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.arguments import finite_number
from steptwin.host.cli.option_names import naming_options
from steptwin.host.cli.output import print_table, say, warn
from steptwin.host.cli.progress import progress_bar
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.motors import MotorVerdict
    from steptwin.host.verify import Comparison


def check_motors(robot: "Robot") -> None:
    """Raise InputError, with the missing key, unless a robot's file describes its motors and masses."""
    from steptwin.host.twin.motors import check_described

    check_described(robot)


def motors_of(robot: "Robot", comparison: "Comparison", current: str | None = None) -> "MotorVerdict":
    """Turn the rotors by a run's record and judge what they did; `current` is what --current says."""
    from steptwin.host.twin.motors import motors_of_run

    current_a = None if current is None else finite_number(current, "--current")
    with naming_options(current_a="--current"), progress_bar(f"motors of {robot.name}") as progress:
        return motors_of_run(robot, comparison, current_a=current_a, progress=progress)


def with_motors(document: Mapping[str, Any], verdict: "MotorVerdict") -> dict[str, Any]:
    """Return a run's document with the motors' verdict: a loss fails the run."""
    reasons = [*document["reasons"], *verdict.reasons]
    return {**document, "passed": document["passed"] and verdict.kept_step, "reasons": reasons} | {
        "motors": verdict.to_dict()
    }


def with_load(robot: "Robot", payload: str | None, supply: str | None) -> "Robot":
    """Return a robot with another payload or supply; raise InputError for one that cannot be."""
    if robot.dynamics is None:
        return robot
    changes: dict[str, Any] = {}
    if payload is not None:
        changes["payload_kg"] = finite_number(payload, "--payload")
    if supply is not None:
        changes["supply_v"] = finite_number(supply, "--supply")
    try:
        return replace(robot, dynamics=replace(robot.dynamics, **changes))
    except InputError as error:
        raise InputError(str(error).replace("payload_kg:", "--payload:").replace("supply_v:", "--supply:")) from error


def print_motors(verdict: "MotorVerdict") -> None:
    """Print a row for each joint, what is short, and the verdict."""
    rows = [
        [
            joint.name,
            joint.motor,
            f"{joint.load_angle_deg:.1f}",
            f"{joint.torque_needed_nm:.3f}",
            f"{joint.torque_available_nm:.3f}",
            f"{100 * joint.margin:.0f}",
            f"{joint.margin_rpm:.0f}",
            f"{joint.lost_full_steps:g}",
            f"{joint.winding_celsius:.1f}",
        ]
        for joint in verdict.joints
    ]
    heads = [
        "joint",
        "motor",
        "load angle deg",
        "needs Nm",
        "has Nm",
        "margin %",
        "at rpm",
        "lost steps",
        "winding degC",
    ]
    print_table(heads, rows, text_columns=2)
    for line in verdict.warnings:
        warn(line)
    said = "keep step" if verdict.kept_step else "LOSE STEPS"
    say(
        f"motors: {said}, with {verdict.payload_kg:g} kg at the tool and {verdict.supply_v:g} V ([A] masses)",
        *(f"  {reason}" for reason in verdict.reasons),
    )
