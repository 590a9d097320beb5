"""`steptwin workspace ROBOT`: compute the reachable positions of the tool, as figures and as a picture."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    PlanningOptions,
    Replace,
    RobotName,
    RobotOptions,
    finite_number,
    keep_files,
    out_folder,
)
from steptwin.host.cli.options import option
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.whole_file import files_together, whole_file, write_json

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.robots.workspace import MonteCarlo, Scan


@dataclass(frozen=True, slots=True)
class WorkspaceOptions:
    """Options for the computation of the workspace, and for its sections."""

    samples: int = option("N", "Random joint positions, up to 10 million.", default=100_000)
    seed: int = option("N", "Seed of the random joint positions.", default=1)
    phi: float | None = option("DEG", "Attitude of the tool in the sections; by default any.", read=finite_number)
    z: float | None = option("MM", "Height of the horizontal section; by default home's.", read=finite_number)


@command("ar4-mk3", "corexy-gantry --z 50 --out out/workspace")
def workspace(
    which: RobotOptions,
    wanted: WorkspaceOptions,
    planning: PlanningOptions,
    robot: RobotName = None,
    out: str | None = option("DIR", "Folder to write figures, cloud and pictures into."),
    replace: Replace = False,
) -> None:
    """Compute the workspace: random positions of all joints, and exact sections with the slides at home."""
    from steptwin.host.robots.workspace import has_sections, monte_carlo, scan

    loaded = which.robot(robot)
    if out is not None:
        keep_files((Path(out) / name for name in _FILES), replace=replace)
    with planning.bounded():
        cloud = monte_carlo(loaded, wanted.samples, wanted.seed)
    folder = None if out is None else out_folder(out, _FILES)
    with planning.bounded():
        scanned = scan(loaded, wanted.phi, wanted.z) if has_sections(loaded) else None
    document = _document(loaded, cloud, scanned)
    pictures = folder is not None and _write(folder, loaded, document, cloud, scanned)
    which.tell_of(loaded, document, lambda: _print_figures(loaded, document))
    if folder is not None:
        which.add_files(
            "figures, cloud and pictures are" if pictures else "figures and cloud are", folder, pictures=pictures
        )


def _document(robot: "Robot", cloud: "MonteCarlo", scanned: "Scan | None") -> dict[str, Any]:
    from steptwin.host.robots.poses.base_frame import STATION

    monte_carlo = {
        "samples": cloud.samples,
        "seed": cloud.seed,
        "counted": cloud.counted,
        "left_out": cloud.left_out,
        **_span("radius", cloud.radius_mm),
        **_span("z", cloud.z_mm),
    }
    if scanned is None:
        return {"monte_carlo": monte_carlo, "plan": None, "profile": None}
    plan, profile = scanned.plan, scanned.profile
    axis_x_mm, axis_y_mm = scanned.axis_mm
    section = {"attitude_deg": scanned.attitude_deg, "slides": dict(scanned.slides), "axis_x_mm": axis_x_mm}
    if robot.base != STATION:
        section["axis_y_mm"] = axis_y_mm
    return {
        "monte_carlo": monte_carlo,
        "plan": {"z_mm": plan.z_mm, **section, **_span("radius", plan.radius_mm), "area_mm2": plan.area_mm2},
        "profile": {
            "azimuth_deg": profile.azimuth_deg,
            **section,
            **_span("radius", profile.radius_mm),
            **_span("z", profile.z_mm),
            "area_mm2": profile.area_mm2,
        },
    }


def _span(quantity: str, span_mm: tuple[float, float] | None) -> dict[str, float | None]:
    least_mm, greatest_mm = span_mm or (None, None)
    return {f"{quantity}_min_mm": least_mm, f"{quantity}_max_mm": greatest_mm}


_FILES: Final = ("workspace.json", "cloud.csv", "workspace.png", "workspace-3d.png")


def _write(folder: Path, robot: "Robot", document: dict[str, Any], cloud: "MonteCarlo", scanned: "Scan | None") -> bool:
    """Write the folder's files together; return False if the pictures are left out without matplotlib."""
    with files_together(folder, stale=_FILES) as parts:
        return _write_parts(parts, robot, document, cloud, scanned)


def _write_parts(
    folder: Path, robot: "Robot", document: dict[str, Any], cloud: "MonteCarlo", scanned: "Scan | None"
) -> bool:
    figures, points, *pictures = (folder / name for name in _FILES)
    write_json(figures, {"robot": robot.name, **document})
    with whole_file(points) as file:
        file.write(b"x_mm,y_mm,z_mm\n")
        file.writelines(f"{x!r},{y!r},{z!r}\n".encode() for x, y, z in cloud.cloud_mm.tolist())
    if not find_spec("matplotlib"):
        return False
    from steptwin.host.record.plots.workspace import write_workspace, write_workspace_3d

    if scanned is not None:
        write_workspace(pictures[0], robot, cloud, scanned)
    write_workspace_3d(pictures[1], robot, cloud)
    return True


_KEYS = ("radius_min_mm", "radius_max_mm", "z_min_mm", "z_max_mm", "area_mm2")


def _print_figures(robot: "Robot", document: dict[str, Any]) -> None:
    from steptwin.host.robots.workspace import orientation_words

    cloud, plan, profile = document["monte_carlo"], document["plan"], document["profile"]
    columns = ["", "r min mm", "r max mm", "z min mm", "z max mm", "area mm2"]
    if plan is None:
        print_table(columns, [["Monte Carlo", *(_figure(cloud, key) for key in _KEYS)]])
        say(f"Monte Carlo: {cloud['samples']} samples with seed {cloud['seed']}")
        say("no sections: the robot's inverse is no closed form")
        return
    rows = {
        "Monte Carlo": cloud,
        f"plan at z = {plan['z_mm']:.6g} mm": plan,
        f"profile at azimuth {round(profile['azimuth_deg'], 6) + 0.0:.6g} deg": profile,
    }
    print_table(columns, [[name, *(_figure(figures, key) for key in _KEYS)] for name, figures in rows.items()])
    left_out = f", {cloud['left_out']} left out: the mechanism forbids them" if cloud["left_out"] else ""
    say(f"Monte Carlo: {cloud['samples']} samples with seed {cloud['seed']}{left_out}")
    orientation = orientation_words(robot, plan["attitude_deg"])
    slides = "".join(f", {name} = {position_mm:g} mm" for name, position_mm in plan["slides"].items())
    say(f"sections: {orientation}{slides}, r about the arm's axis")
    say("plan: horizontal; profile: upright, from the arm's axis to its azimuth, 0 deg along x")


def _figure(figures: dict[str, Any], key: str) -> str:
    """Return a length to the micrometre, an area to the mm2; further digits would depend on the scan."""
    value = figures.get(key)
    if value is None:
        return "-"
    return f"{value:.0f}" if key == "area_mm2" else f"{value:.3f}"
