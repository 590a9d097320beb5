"""`steptwin fk ROBOT Q1 Q2 ...`: compute the tool's pose from joint positions."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotAndJoints, RobotOptions
from steptwin.host.cli.options import switch
from steptwin.host.cli.output import fixed, pose_words, print_table, say
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.common.arrays import FloatArray
    from steptwin.host.robots.kinematics import Kinematics


_COLUMNS: Final = ("n", "o", "a", "p")


def matrices_document(kinematics: "Kinematics", joints: "FloatArray") -> dict[str, Any]:
    """Return the DH table with its values and matrices at joints of shape (1, joints); matrices are lists of rows."""
    from steptwin.host.robots.kinematics.base import link_frames, tool_frames
    from steptwin.host.robots.poses.base_frame import STATION

    variables = kinematics.dh_variables(joints)
    links = [
        {
            "alpha_deg": float(row.alpha_deg),
            "a_mm": float(row.a_mm),
            "d_mm": float(row.d_mm.values(variables).item()),
            "theta_deg": float(row.theta_deg.values(variables).item()),
            "d": str(row.d_mm),
            "theta": str(row.theta_deg),
            "matrix": _plain(frame[0]),
        }
        for row, frame in zip(kinematics.dh.rows, link_frames(kinematics, joints), strict=True)
    ]
    product = tool_frames(kinematics, joints)[0]
    axes = {name: _plain(product[:3, column]) for column, name in enumerate(_COLUMNS)}
    base = kinematics.dh.base
    return {
        **({} if base == STATION else {"base": {**asdict(base), "matrix": _plain(base.matrix)}}),
        "convention": kinematics.dh.convention.value,
        "links": links,
        "product": {"matrix": _plain(product), **axes},
    }


def print_matrices(document: dict[str, Any]) -> None:
    """Print the table, then three rows for each matrix, whose fourth is always 0 0 0 1."""
    links = document["links"]
    modified = document["convention"] == "modified"
    start = "base" if "base" in document else "world"
    say(f"DH table, {'modified (Craig, proximal)' if modified else 'standard (distal)'}, from the {start} to the tool:")
    place = "i-1" if modified else "i"
    names = [f"alpha_{place} deg", f"a_{place} mm", "d_i mm", "theta_i deg"]
    keys = ("alpha_deg", "a_mm", "d_mm", "theta_deg")
    rows = [
        [str(i), link["d"], link["theta"], *(fixed(link[key]) for key in keys)] for i, link in enumerate(links, start=1)
    ]
    print_table(["i", "d_i", "theta_i", *names], rows, text_columns=3)
    of_base = "S_0T, the base in the station, " if "base" in document else ""
    whole = f"their product from the {'station' if of_base else 'world'} to the tool"
    say("", f"{of_base}matrix of each link, and T, {whole}; each has a fourth row 0 0 0 1:")
    base = {"S_0T": document["base"]["matrix"]} if "base" in document else {}
    of_links = {f"T{i}": link["matrix"] for i, link in enumerate(links, start=1)}
    matrices = base | of_links | {"T": document["product"]["matrix"]}
    rows = [
        [name if axis == 0 else "", "xyz"[axis], *(fixed(element, 6) for element in matrix[axis])]
        for name, matrix in matrices.items()
        for axis in range(3)
    ]
    print_table(["", "", *_COLUMNS], rows, text_columns=2)


def _plain(array: "FloatArray") -> Any:
    """Return nested lists, without zeros that have a sign."""
    return (array + 0.0).tolist()


@command("lab-scara 150 0 90 0 --matrices", "warehouse-scara 0 0 200 -60 120 -90 --json", negatives=True)
def fk(
    which: RobotOptions,
    words: RobotAndJoints = None,
    matrices: bool = switch("Also the DH table, the matrix of each link and their product."),
) -> None:
    """Compute the tool's pose from joint positions (forward kinematics).

    If the robot's file states errors of its DH parameters, also say where the tool really is.
    """
    import numpy as np

    from steptwin.host.robots.kinematics import make_kinematics
    from steptwin.host.robots.kinematics.chain import actual_chain

    loaded, values = which.robot_and_joints(words)
    for joint, value in zip(loaded.joints, values, strict=True):
        if not joint.lower <= value <= joint.upper:
            limits = f"{joint.lower:g}..{joint.upper:g} {joint.unit}"
            say(f"note: {joint.name} = {value:g} is outside its limits {limits}", err=True)
    kinematics = make_kinematics(loaded)
    if not kinematics.task.width:
        raise InputError(f"{loaded.name} has no tool: its joints have positions, but no pose")
    pose = kinematics.forward(np.array([values]))[0]
    if not np.isfinite(pose).all():
        at = " ".join(f"{value:g}" for value in values)
        raise InputError(f"joints of {loaded.name}: the mechanism cannot be assembled at {at}")
    document: dict[str, Any] = {
        "joints": dict(zip(loaded.joint_names, values, strict=True)),
        "pose": kinematics.task.document(pose),
    }
    chain = actual_chain(loaded)
    if chain:
        actual = chain.poses(np.array([values]))[0]
        document["actual_pose"] = kinematics.task.document(actual)
        document["actual_tilt_deg"] = float(chain.tilts_deg(np.array([values]))[0])
        document["position_error_mm"] = float(np.linalg.norm(actual[:3] - pose[:3]))
    if matrices:
        document["dh"] = matrices_document(kinematics, np.array([values]))
    in_words = [pose_words(document["pose"], 6, "attitude deg")]
    if chain:
        off = f"{document['position_error_mm']:.6f} mm away, tilted by {document['actual_tilt_deg']:.6f} deg"
        actually = pose_words(document["actual_pose"], 6, "attitude deg")
        in_words += [f"actual: {actually}", f"{off}, by the dh_errors of the robot's file"]
    tables = ("", lambda: print_matrices(document["dh"])) if matrices else ()
    which.tell_of(loaded, document, *in_words, *tables)
