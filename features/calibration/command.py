"""`steptwin calibrate ROBOT [FILE]`: find errors of a machine's DH parameters, and print the effect of each."""

from collections.abc import Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    PlanningOptions,
    Replace,
    RobotOptions,
    finite_number,
    joint_values,
    keep_files,
    out_folder,
)
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.output import Columns, fixed, number_of, print_rows, print_table, say
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.whole_file import files_together, write_json, write_whole

if TYPE_CHECKING:
    from steptwin.features.calibration.identification import Identification, Parameter
    from steptwin.host.robots.robot import Robot

_ROBOT, _FIGURES, _PICTURE = _FILES = ("robot.toml", "calibration.json", "residuals.png")
"""Files in the folder of --out."""
_NOISE_MM, _SEED = 0.02, 1


@command("my-arm.toml measured.csv --out out/calibration", "calibration-scara --at '30 45 50 20'")
def calibrate(
    which: RobotOptions,
    planning: PlanningOptions,
    words: list[str] | None = argument(
        "ROBOT [FILE]",
        "The robot, and a CSV file of measurements with the header JOINT,...,x,y,z, in mm and degrees.",
    ),
    out: str | None = option("DIR", "Folder to write the corrected robot file, figures and picture into."),
    replace: Replace = False,
    at: str | None = option(
        "'Q1 Q2 ...'", "Print instead how far each parameter takes the tool, with the joints there."
    ),
    simulate: int | None = option("N", "Write FILE instead, with N simulated poses of the robot as it really is."),
    noise_mm: float | None = option(
        "MM", f"With --simulate: noise of each coordinate, by default {_NOISE_MM:g}.", read=finite_number
    ),
    seed: int | None = option("N", f"With --simulate: seed of poses and noise, by default {_SEED}."),
) -> None:
    """Find the real DH parameters of a machine from where its tool was measured, and what that cannot tell.

    Each line of the file is a pose: where the joints stood, and where the tool was, in the robot's world frame. The
    errors found go to the robot file in the folder, under [dh_errors]: `fk`, `check` and the reports of runs with this
    file tell where the tool really is.

    For robots that are chains of DH links. --at prints the error transfer coefficients: the derivatives of the tool's
    position and of its turns about the world's axes, per mm of a length and per degree of an angle.
    """
    for_simulation = {"--noise-mm": noise_mm, "--seed": seed}
    others = {"--out": out, "--simulate": simulate, **for_simulation}
    if at is not None:
        _check_left_out("--at", others)
        _print_coefficients(which, *which.robot_and_rest(words), at)
        return
    loaded, file = which.robot_and_file(words, "FILE of measurements")
    if simulate is not None:
        _check_left_out("--simulate", {"--out": out})
        keep_files([Path(file)], replace=replace)
        _simulate(which, loaded, file, simulate, noise_mm=noise_mm, seed=seed)
        return
    _check_left_out("measurements in a file", for_simulation)
    _calibrate(which, planning, loaded, file, out, replace=replace)


def _check_left_out(what: str, options: Mapping[str, object]) -> None:
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name} {value}: is not for {what}")


def _print_coefficients(which: RobotOptions, robot: "Robot", rest: list[str], at: str) -> None:
    """Print the effect of each parameter's error on the nominal tool, and the total of those in the robot's file."""
    import numpy as np

    from steptwin.host.robots.kinematics.chain import MOVES, Chain
    from steptwin.host.robots.link_errors import unit_of

    if rest:
        raise InputError(f"unexpected argument '{rest[0]}': --at needs no measurements")
    joints = joint_values(at.split(), robot.joint_names, "--at")
    chain, errors = Chain.of(robot), Chain.of(robot).errors.ravel()
    moves = chain.with_errors(np.zeros_like(errors)).sensitivities(np.array([joints]))[0]
    rows = dict(zip(chain.parameters, moves.T.tolist(), strict=True))
    total = (moves @ errors).tolist()
    table = [
        [name, unit_of(name), f"{error:g}", *map(fixed, row)]
        for (name, row), error in zip(rows.items(), errors, strict=True)
    ]
    which.tell_of(
        robot,
        {
            "joints": dict(zip(robot.joint_names, joints, strict=True)),
            "per": {name: dict(zip(MOVES, row, strict=True)) for name, row in rows.items()},
            "together": dict(zip(MOVES, total, strict=True)),
        },
        lambda: print_table(
            ["parameter", "per", "error", *(move.replace("_", " ") for move in MOVES)],
            [*table, ["together", "", "", *map(fixed, total)]],
            text_columns=2,
        ),
        f"{chain.table.convention.value} DH parameters;"
        f" link1 is at the world, {chain.table.link_names[-1]} at the tool",
    )


def _simulate(
    which: RobotOptions, robot: "Robot", file: str, poses: int, *, noise_mm: float | None, seed: int | None
) -> None:
    from steptwin.features.calibration.measurements import measurements_text, simulate_measurements

    noise_mm, seed = _NOISE_MM if noise_mm is None else noise_mm, _SEED if seed is None else seed
    with naming_options("noise_mm", "seed", poses="--simulate"):
        measured = simulate_measurements(robot, poses, noise_mm, seed)
    nominal = f"{robot.name} states no dh_errors: the tool was where the nominal model has it"
    write_whole(Path(file), measurements_text(robot, measured))
    which.tell_of(
        robot,
        {"file": file, "poses": poses, "noise_mm": noise_mm, "seed": seed, "dh_errors": bool(robot.dh_errors)},
        f"{file}: {poses} simulated poses of {robot.name}, noise {noise_mm:g} mm, seed {seed}",
        *([] if robot.dh_errors else [nominal]),
    )


def _calibrate(
    which: RobotOptions, planning: PlanningOptions, robot: "Robot", file: str, out: str | None, *, replace: bool
) -> None:
    from steptwin.features.calibration.identification import corrected_text, identify_errors
    from steptwin.features.calibration.measurements import read_measurements
    from steptwin.host.robots.kinematics.chain import Chain

    if out is not None:
        keep_files((Path(out) / name for name in _FILES), replace=replace)
    chain, measurements = Chain.of(robot), read_measurements(file, robot)
    with planning.bounded(), prefixed(f"{file}: "):
        found = identify_errors(chain, measurements)
    folder = None if out is None else out_folder(out, _FILES)
    document = _document(found)
    picture = False
    if folder is not None:
        text = corrected_text(robot, found.chain.link_errors, f"found by a calibration of {len(measurements)} poses")
        with files_together(folder, stale=_FILES) as parts:
            write_whole(parts / _ROBOT, text)
            write_json(parts / _FIGURES, {"robot": robot.name, **document})
            picture = bool(find_spec("matplotlib")) and _draw(parts / _PICTURE, robot.name, found)
    which.tell_of(robot, document, lambda: _print(found, document))
    if folder is not None:
        which.add_files(f"corrected robot file, figures{' and picture' if picture else ''} are", folder)
        if not picture:
            say(f"no picture: matplotlib is not installed ({installing('plot')})", err=True)


def _document(found: "Identification") -> dict[str, Any]:
    import numpy as np

    from steptwin.features.calibration.identification import rms_mm

    residuals = (("residual_before_mm", found.before_mm), ("residual_after_mm", found.after_mm))
    return {
        "poses": len(found.measurements),
        "repeated": found.measurements.repeats,
        "rank": found.rank,
        "condition": found.condition,
        "noise_mm": found.noise_mm,
        **{name: {"rms": rms_mm(mm), "max": float(np.linalg.norm(mm, axis=1).max())} for name, mm in residuals},
        "worst_line": found.worst_line,
        "parameters": [
            asdict(parameter) | {"acts_as": {name: share for share, name in parameter.acts_as}}
            for parameter in found.parameters
        ],
    }


def _draw(path: Path, robot: str, found: "Identification") -> bool:
    from steptwin.features.calibration.residuals import write_residuals

    write_residuals(path, robot, found)
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
    before, after, repeats = document["residual_before_mm"], document["residual_after_mm"], found.measurements.repeats
    again = f" ({number_of(repeats, 'measurement')} of a repeated pose: each pose counts once)" if repeats else ""
    say(
        f"rank {found.rank} of {len(found.parameters)} parameters, condition {found.condition:.3g},"
        f" from {document['poses']} poses{again}",
        f"residual before: {before['rms']:.4f} mm rms, {before['max']:.4f} mm max",
        f"residual after: {after['rms']:.4f} mm rms, {after['max']:.4f} mm max, at line {document['worst_line']};"
        f" {found.noise_mm:.4f} mm in each coordinate",
    )


def _why(parameter: "Parameter") -> str:
    if not parameter.acts_as:
        return f"{parameter.name} does not move the tool's position"
    terms = " + ".join(name if f"{share:.3g}" == "1" else f"{share:.3g} {name}" for share, name in parameter.acts_as)
    return f"{parameter.name} acts as {terms.replace('+ -', '- ')}"
