"""`steptwin fk ROBOT Q1 Q2 ...`: compute the tool's pose from joint positions."""

from typing import Annotated, Any

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotAndJoints, RobotFile, robot_and_joints
from steptwin.host.cli.matrices import matrices_document, print_matrices
from steptwin.host.cli.output import fixed, print_json, say
from steptwin.host.common.errors import InputError


@command("lab-scara 150 0 90 0 --matrices", "warehouse-scara 0 0 200 -60 120 -90 --json", negatives=True)
def fk(
    words: RobotAndJoints = None,
    robot_file: RobotFile = None,
    matrices: Annotated[
        bool, typer.Option("--matrices", help="Also the DH table, the matrix of each link and their product.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Compute the tool's pose from joint positions (forward kinematics).

    If the robot's file states errors of its DH parameters, also say where the tool really is.
    """
    import numpy as np

    from steptwin.host.robots.kinematics import make_kinematics
    from steptwin.host.robots.kinematics.base import POSE_KEYS
    from steptwin.host.robots.kinematics.chain import actual_chain

    loaded, values = robot_and_joints(words or [], robot_file)
    for joint, value in zip(loaded.joints, values, strict=True):
        if not joint.lower <= value <= joint.upper:
            limits = f"{joint.lower:g}..{joint.upper:g} {joint.unit}"
            say(f"note: {joint.name} = {value:g} is outside its limits {limits}", err=True)
    kinematics = make_kinematics(loaded)
    pose = kinematics.forward(np.array([values]))[0]
    if not np.isfinite(pose).all():
        at = " ".join(f"{value:g}" for value in values)
        raise InputError(f"joints of {loaded.name}: the mechanism cannot be assembled at {at}")
    document: dict[str, Any] = {
        "robot": loaded.name,
        "joints": dict(zip(loaded.joint_names, values, strict=True)),
        "pose": {key: float(value) for key, value in zip(POSE_KEYS, pose, strict=True)},
    }
    chain = actual_chain(loaded)
    if chain:
        actual = chain.poses(np.array([values]))[0]
        document["actual_pose"] = dict(zip(POSE_KEYS, actual.tolist(), strict=True))
        document["actual_tilt_deg"] = float(chain.tilts_deg(np.array([values]))[0])
        document["position_error_mm"] = float(np.linalg.norm(actual[:3] - pose[:3]))
    if matrices:
        document["dh"] = matrices_document(kinematics, np.array([values]))
    if as_json:
        print_json(document)
        return
    say(_words(document["pose"]))
    if chain:
        off = f"{document['position_error_mm']:.6f} mm away, tilted by {document['actual_tilt_deg']:.6f} deg"
        say(f"actual: {_words(document['actual_pose'])}", f"{off}, by the dh_errors of the robot's file")
    if matrices:
        say("")
        print_matrices(document["dh"])


def _words(pose: dict[str, float]) -> str:
    x, y, z, attitude = (fixed(value, 6) for value in pose.values())
    return f"x {x} mm, y {y} mm, z {z} mm, attitude {attitude} deg"
