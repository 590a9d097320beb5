"""`steptwin measure ROBOT FILE`: simulate the measurements of a calibration."""

from pathlib import Path
from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    AsJson,
    Replace,
    RobotFile,
    finite_number,
    keep_files,
    naming_options,
    robot_and_rest,
)
from steptwin.host.cli.output import print_json, say
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file


@command("my-arm.toml measured.csv", "my-arm.toml measured.csv --poses 20 --noise-mm 0.05")
def measure(
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="ROBOT FILE", help="The robot as it really is, and the CSV file to write."),
    ] = None,
    robot_file: RobotFile = None,
    poses: Annotated[int, typer.Option(metavar="N", help="Number of poses.")] = 50,
    noise_mm: Annotated[
        str, typer.Option("--noise-mm", metavar="MM", help="Standard deviation of each measured coordinate.")
    ] = "0.02",
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of poses and noise.")] = 1,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Simulate measurements of the tool for `calibrate`: random poses of a robot with errors in its DH parameters.

    The errors are those that the robot's file states under [dh_errors]; without any, the tool is where the nominal
    model has it. The file has a line for each pose: where the joints stand, and where the tool was measured.
    """
    from steptwin.host.studies.calibration import measurements_text, simulate_measurements

    loaded, rest = robot_and_rest(words or [], robot_file)
    if len(rest) != 1:
        raise InputError(f"one FILE is needed after the robot, not {' '.join(rest) or 'nothing'}")
    path = Path(rest[0])
    keep_files([path], replace=replace)
    noise = finite_number(noise_mm, "--noise-mm")
    with naming_options("poses", "noise_mm", "seed"):
        measured = simulate_measurements(loaded, poses, noise, seed)
    with whole_file(path) as file:
        file.write(measurements_text(loaded, measured).encode())
    if as_json:
        figures = {"file": str(path), "poses": poses, "noise_mm": noise, "seed": seed}
        print_json({"robot": loaded.name, **figures, "dh_errors": bool(loaded.dh_errors)})
        return
    say(f"{path}: {poses} simulated poses of {loaded.name}, noise {noise:g} mm, seed {seed}")
    if not loaded.dh_errors:
        say(f"{loaded.name} states no dh_errors: the tool was where the nominal model has it")
