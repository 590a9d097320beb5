"""Show an arm's DH table at one position, the matrix of each of its links, and their product."""

from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.output import fixed, print_table, say

if TYPE_CHECKING:
    from steptwin.host.common.arrays import FloatArray
    from steptwin.host.robots.kinematics import Kinematics

_COLUMNS: Final = ("n", "o", "a", "p")


def matrices_document(kinematics: "Kinematics", joints: "FloatArray") -> dict[str, Any]:
    """Return the DH table with its values and matrices at joints of shape (1, joints); matrices are lists of rows."""
    from steptwin.host.robots.kinematics.frames import link_frames, tool_frames

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
    return {
        "convention": kinematics.dh.convention.value,
        "links": links,
        "product": {"matrix": _plain(product), **axes},
    }


def print_matrices(document: dict[str, Any]) -> None:
    """Print the table, then three rows for each matrix, whose fourth is always 0 0 0 1."""
    links = document["links"]
    modified = document["convention"] == "modified"
    say(f"DH table, {'modified (Craig, proximal)' if modified else 'standard (distal)'}, from the world to the tool:")
    place = "i-1" if modified else "i"
    names = [f"alpha_{place} deg", f"a_{place} mm", "d_i mm", "theta_i deg"]
    keys = ("alpha_deg", "a_mm", "d_mm", "theta_deg")
    rows = [
        [str(i), link["d"], link["theta"], *(fixed(link[key]) for key in keys)] for i, link in enumerate(links, start=1)
    ]
    print_table(["i", "d_i", "theta_i", *names], rows, text_columns=3)
    say("", "matrix of each link, and T, their product from the world to the tool; each has a fourth row 0 0 0 1:")
    matrices = {f"T{i}": link["matrix"] for i, link in enumerate(links, start=1)} | {"T": document["product"]["matrix"]}
    rows = [
        [name if axis == 0 else "", "xyz"[axis], *(fixed(element, 6) for element in matrix[axis])]
        for name, matrix in matrices.items()
        for axis in range(3)
    ]
    print_table(["", "", *_COLUMNS], rows, text_columns=2)


def _plain(array: "FloatArray") -> Any:
    """Return nested lists, without zeros that have a sign."""
    return (array + 0.0).tolist()
