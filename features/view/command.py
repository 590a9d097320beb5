"""`steptwin view DIR` and `animate DIR`: show a stored run, in a browser and as a moving picture."""

from dataclasses import MISSING, dataclass
from pathlib import Path

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, PlanDir, Replace, RunDir, keep_files
from steptwin.host.cli.live.served_programs import require_extra
from steptwin.host.cli.options import argument, naming_options, option, switch
from steptwin.host.cli.output import progress_bar, say, warn


@command("out/drawer-pull", "out/today out/yesterday")
def view(
    folder: RunDir,
    other: Path | None = argument("[DIR_B]", "Another run of the robot, shown beside the first."),
    plan: PlanDir = None,
    port: int | None = option("PORT", "Port of the page; by default 8090, or a free one; 0 is free."),
) -> None:
    """Replay a stored run in a browser, until Ctrl-C: arm, joints, pins, currents and marks at any instant.

    With two runs, both arms are shown and how far they are apart. Only this machine reaches the page.
    """
    require_extra()
    from steptwin.features.view.page import serve_replay

    folders = (folder,) if other is None else (folder, other)
    with naming_options("port", plan_folder="--plan"):
        serve_replay(folders, plan, port, lambda url: say(f"view: {url}", "Ctrl-C ends it"))


@dataclass(frozen=True, slots=True)
class FilmOptions:
    """The options that say what a film shows, and how."""

    camera: str = option(
        "NAME|AZIMUTH,ELEVATION", "iso, top, front, side, or two angles in degrees, such as -60,30.", default="iso"
    )
    speed: float | None = option("FACTOR", "1 is real time; by default the motion takes some seconds, 10 at most.")
    from_s: float | None = option("SECONDS", "First time of the motion.", "--from")
    to_s: float | None = option("SECONDS", "Last time of the motion.", "--to")
    magnify: float | None = option("FACTOR", "Magnify the path's error so many times; by default until it shows.")
    frames: bool = switch("Also draw the frames of base, joints and tool: x red, y green, z blue.")
    pulses: float | None = option("MS", "Below a gif or mp4, show each driver's CLK pin in so many ms before it.")
    fps: float = option("N", "Frames a second.", default=20.0)
    width: int = option("PIXELS", "Width of a gif or mp4.", default=720)


@command("out/drawer-pull --out arm.gif", "out/drawer-pull --out arm.html --camera 30,20 --speed 0.5")
def animate(
    wanted: FilmOptions,
    answer: AnswerOptions,
    folder: RunDir,
    out: Path = option(
        "FILE",
        "arm.gif; arm.html, a page that plays and turns in any browser; or arm.mp4, which needs ffmpeg.",
        default=MISSING,
    ),
    plan: PlanDir = None,
    replace: Replace = False,
) -> None:
    """Show a stored run as a moving picture: the arm, its planned path and the counted one, error magnified."""
    from steptwin.host.record.animation import Camera, Shot, check_kind, write_animation
    from steptwin.host.record.folder import read_run

    with naming_options(
        "out", "camera", "speed", "fps", "width", from_s="--from", to_s="--to", gain="--magnify", pulses_ms="--pulses"
    ):
        check_kind(out)
        keep_files([out], replace=replace)
        seen_from = Camera.named(wanted.camera)
        with naming_options(plan_folder="--plan"):
            stored = read_run(folder, plan, counts_suffice=True)
        if stored.interruption:
            warn(f"{folder}: {stored.interruption}")
        if stored.no_plan:
            warn(f"{folder}: has no plan: {stored.no_plan}; this shows what the drivers have counted")
        shot = Shot(wanted.fps, wanted.speed, wanted.from_s, wanted.to_s, wanted.magnify, wanted.frames, wanted.pulses)
        with progress_bar(out.name) as progress:
            film = write_animation(out, stored, seen_from, shot, wanted.width, progress)
    frames, lasts_s = len(film.times_s), (len(film.times_s) - 1) / film.fps
    answer.tell(
        {"file": str(out), "frames": frames, "duration_s": lasts_s, "speed": film.speed, "magnified": film.gain},
        f"{out}: {frames} frames, {lasts_s:.1f} s at {film.speed:g} x, path's error magnified {film.gain:g} times",
    )
