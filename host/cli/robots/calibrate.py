"""`steptwin sensitivity|measure|calibrate ROBOT`: what errors of DH parameters do, and which ones a machine has."""

from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    PlanningOptions,
    Replace,
    RobotAndJoints,
    RobotOptions,
    finite_number,
    keep_files,
    out_folder,
)
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.output import Columns, fixed, number_of, print_rows, print_table, say
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.extras import installing
from steptwin.host.common.whole_file import files_together, write_json, write_whole

if TYPE_CHECKING:
    from steptwin.host.common.arrays import FloatArray
    from steptwin.host.robots.kinematics.chain import Chain
    from steptwin.host.robots.robot import Robot
    from steptwin.host.studies.calibration import Identification, Parameter

_ROBOT, _FIGURES, _PICTURE = _FILES = ("robot.toml", "calibration.json", "residuals.png")
"""The files in the folder of --out."""


@command("calibration-scara 30 45 50 20", "lab-scara 150 0 90 0 --json", negatives=True)
def sensitivity(which: RobotOptions, words: RobotAndJoints = None) -> None:
    """Compute how far an error of each DH parameter takes the tool: the error transfer coefficients at a position.

    A row has the derivatives of the tool's position and of its turns about the world's axes, per mm of a length and per
    degree of an angle. A turn rz adds to the attitude. For robots that are chains of DH links, at the nominal arm.

    If the robot's file states errors, also how they act together: each error times its coefficients, the sum, the exact
    difference between the actual and the nominal tool, and what the sum leaves out.
    """
    import numpy as np

    from steptwin.host.robots.kinematics.chain import MOVES, Chain
    from steptwin.host.robots.link_errors import unit_of

    loaded, values = which.robot_and_joints(words)
    chain = Chain.of(loaded)
    joints = np.array([values])
    moves = chain.with_errors(np.zeros_like(chain.errors)).sensitivities(joints)[0].T.tolist()
    together = _together(chain, joints) if loaded.dh_errors else {}
    rows = dict(zip(chain.parameters, moves, strict=True))
    columns = [move.replace("_", " ") for move in MOVES]
    which.tell_of(
        loaded,
        {
            "joints": dict(zip(loaded.joint_names, values, strict=True)),
            "per": {name: dict(zip(MOVES, row, strict=True)) for name, row in rows.items()},
            **together,
        },
        lambda: print_table(
            ["parameter", "per", *columns],
            [[name, unit_of(name), *map(fixed, row)] for name, row in rows.items()],
            text_columns=2,
        ),
        f"{chain.table.convention.value} DH parameters;"
        f" link1 is at the world, {chain.table.link_names[-1]} at the tool",
        *([lambda: _print_together(together, columns)] if together else []),
    )


def _together(chain: "Chain", joints: "FloatArray") -> dict[str, Any]:
    """Return how the errors of a chain act together at joints of shape (1, joints)."""
    from steptwin.host.robots.kinematics.chain import MOVES

    found, errors = chain.synthesis(joints), zip(chain.parameters, chain.errors.ravel().tolist(), strict=True)
    return {
        "parts": {
            name: {"error": error, **dict(zip(MOVES, part, strict=True))}
            for (name, error), part in zip(errors, found.parts[0].T.tolist(), strict=True)
            if error
        },
        **{
            name: dict(zip(MOVES, moves[0].tolist(), strict=True))
            for name, moves in (("sum", found.linear), ("exact", found.exact), ("remainder", found.remainder))
        },
    }


def _print_together(document: dict[str, Any], columns: list[str]) -> None:
    from steptwin.host.robots.link_errors import unit_of

    parts = [
        [name, f"{part['error']:g} {unit_of(name)}", *(fixed(part[key]) for key in part if key != "error")]
        for name, part in document["parts"].items()
    ]
    sums = [[name, "", *map(fixed, document[name].values())] for name in ("sum", "exact", "remainder")]
    say("", "the file's errors together, each times its coefficients:")
    print_table(["parameter", "error", *columns], [*parts, *sums], text_columns=2)
    say("exact is the actual tool minus the nominal one, remainder what the sum leaves out")


@command("my-arm.toml measured.csv", "my-arm.toml measured.csv --poses 20 --noise-mm 0.05")
def measure(
    which: RobotOptions,
    words: list[str] | None = argument("ROBOT FILE", "The robot as it really is, and the CSV file to write."),
    poses: int = option("N", "Number of poses.", default=50),
    noise_mm: float = option(
        "MM", "Standard deviation of each measured coordinate.", default="0.02", read=finite_number
    ),
    seed: int = option("N", "Seed of poses and noise.", default=1),
    replace: Replace = False,
) -> None:
    """Simulate measurements of the tool for `calibrate`: random poses of a robot with errors in its DH parameters.

    The errors are those that the robot's file states under [dh_errors]; without any, the tool is where the nominal
    model has it. The file has a line for each pose: where the joints stand, and where the tool was measured.
    """
    from steptwin.host.studies.calibration import measurements_text, simulate_measurements

    loaded, file = which.robot_and_file(words, "FILE")
    path = Path(file)
    keep_files([path], replace=replace)
    with naming_options("poses", "noise_mm", "seed"):
        measured = simulate_measurements(loaded, poses, noise_mm, seed)
    write_whole(path, measurements_text(loaded, measured))
    figures = {"file": str(path), "poses": poses, "noise_mm": noise_mm, "seed": seed}
    nominal = f"{loaded.name} states no dh_errors: the tool was where the nominal model has it"
    which.tell_of(
        loaded,
        figures | {"dh_errors": bool(loaded.dh_errors)},
        f"{path}: {poses} simulated poses of {loaded.name}, noise {noise_mm:g} mm, seed {seed}",
        *([] if loaded.dh_errors else [nominal]),
    )


@command("calibration-scara measured.csv", "my-arm.toml measured.csv --out out/calibration")
def calibrate(
    which: RobotOptions,
    planning: PlanningOptions,
    words: list[str] | None = argument(
        "ROBOT FILE",
        "The robot, and a CSV file of measurements with the header JOINT,...,x,y,z, in mm and degrees.",
    ),
    out: str | None = option("DIR", "Folder to write the corrected robot file, figures and picture into."),
    replace: Replace = False,
) -> None:
    """Find the real DH parameters of a machine from where its tool was measured, and what that cannot tell.

    Each line of the file is a pose: where the joints stood, and where the tool was, in the robot's world frame. The
    errors found go to the robot file in the folder, under [dh_errors]: `fk`, `check` and the reports of runs with this
    file tell where the tool really is. `measure` simulates such a file.
    """
    from steptwin.host.robots.kinematics.chain import Chain
    from steptwin.host.studies.calibration import corrected_text, identify_errors, read_measurements

    loaded, file = which.robot_and_file(words, "FILE of measurements")
    if out is not None:
        keep_files((Path(out) / name for name in _FILES), replace=replace)
    chain, measurements = Chain.of(loaded), read_measurements(file, loaded)
    with planning.bounded(), prefixed(f"{file}: "):
        found = identify_errors(chain, measurements)
    folder = None if out is None else out_folder(out, _FILES)
    document = _document(found)
    picture = False
    if folder is not None:
        text = corrected_text(loaded, found.chain.link_errors, f"found by a calibration of {len(measurements)} poses")
        with files_together(folder, stale=_FILES) as parts:
            write_whole(parts / _ROBOT, text)
            write_json(parts / _FIGURES, {"robot": loaded.name, **document})
            picture = _write_picture(parts / _PICTURE, loaded, found)
    which.tell_of(loaded, document, lambda: _print(found, document))
    if folder is not None:
        which.add_files(f"corrected robot file, figures{' and picture' if picture else ''} are", folder)
        if not picture:
            say(f"no picture: matplotlib is not installed ({installing('plot')})", err=True)


def _document(found: "Identification") -> dict[str, Any]:
    from steptwin.host.studies.calibration import largest_mm, rms_mm

    return {
        "poses": len(found.measurements),
        "repeated": found.measurements.repeats,
        "rank": found.rank,
        "condition": found.condition,
        "noise_mm": found.noise_mm,
        "residual_before_mm": {"rms": rms_mm(found.before_mm), "max": largest_mm(found.before_mm)},
        "residual_after_mm": {"rms": rms_mm(found.after_mm), "max": largest_mm(found.after_mm)},
        "worst_line": found.worst_line,
        "parameters": [
            asdict(parameter) | {"acts_as": {name: share for share, name in parameter.acts_as}}
            for parameter in found.parameters
        ],
    }


def _write_picture(path: Path, robot: "Robot", found: "Identification") -> bool:
    """Draw the residuals; return False if matplotlib is not installed."""
    if not find_spec("matplotlib"):
        return False
    from steptwin.host.studies.calibration.residuals import write_residuals

    write_residuals(path, robot.name, found)
    return True


def _print(found: "Identification", document: dict[str, Any]) -> None:
    from steptwin.host.robots.link_errors import unit_of

    columns: Columns = {
        "parameter": "{0.name}",
        "unit": lambda parameter: unit_of(parameter.name),
        "before": lambda parameter: fixed(parameter.before),
        "found": lambda parameter: fixed(parameter.found),
        "3 sigma": lambda parameter: fixed(3 * (parameter.deviation or 0.0)),
    }
    print_rows(columns, [parameter for parameter in found.parameters if parameter.identified], text_columns=2)
    others = [parameter for parameter in found.parameters if not parameter.identified]
    if others:
        say("not told apart by these poses, and left as they are:", *(f"  {_why(other)}" for other in others))
    before, after = document["residual_before_mm"], document["residual_after_mm"]
    say(
        f"rank {found.rank} of {len(found.parameters)} parameters, condition {found.condition:.3g},"
        f" from {document['poses']} poses{_repeats(found)}",
        f"residual before: {before['rms']:.4f} mm rms, {before['max']:.4f} mm max",
        f"residual after: {after['rms']:.4f} mm rms, {after['max']:.4f} mm max, at line {document['worst_line']};"
        f" {found.noise_mm:.4f} mm in each coordinate",
    )


def _repeats(found: "Identification") -> str:
    repeats = found.measurements.repeats
    return f" ({number_of(repeats, 'measurement')} of a repeated pose: each pose counts once)" if repeats else ""


def _why(parameter: "Parameter") -> str:
    if not parameter.acts_as:
        return f"{parameter.name} does not move the tool's position"
    terms = " + ".join(name if f"{share:.3g}" == "1" else f"{share:.3g} {name}" for share, name in parameter.acts_as)
    return f"{parameter.name} acts as {terms.replace('+ -', '- ')}"
