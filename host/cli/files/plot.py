"""`steptwin plot DIR`: draw pictures of a stored run."""

from dataclasses import dataclass, replace
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Literal

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, PlanDir, Replace, RunDir, chosen_names, keep_files
from steptwin.host.cli.options import given_options, naming_options, option, switch
from steptwin.host.cli.output import warn
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.record.plots import PICTURES, PlotView, write_plots


@dataclass(frozen=True, slots=True)
class CloseUpOptions:
    """Options of pictures with a short time span."""

    at_s: float | None = option("SECONDS", "For edges and phases: their middle; by default the fastest.", "--at")
    span_s: float | None = option("SECONDS", "For edges and phases: their width; by default some steps.", "--span")

    def check_use(self, names: list[str]) -> None:
        """Raise InputError if an option is given for pictures of the whole motion."""
        given = list(given_options(self))
        if given and not any(PICTURES[name].close_up for name in names):
            close_ups = " and ".join(name for name, each in PICTURES.items() if each.close_up)
            raise InputError(f"{given[0]}: is for the pictures {close_ups}, not for {', '.join(names)}")

    def view(self, duration_s: float) -> PlotView:
        """Return the time span of the pictures; raise InputError if it is outside the motion."""
        from steptwin.protocol.timer import COUNTS_PER_SECOND

        at_s, span_s, count_s = self.at_s, self.span_s, 1 / COUNTS_PER_SECOND
        if at_s is not None and not (isfinite(at_s) and 0.0 <= at_s <= duration_s):
            raise InputError(f"--at {at_s:g} s: the motion goes from 0 to {duration_s:g} s")
        if span_s is not None and not (isfinite(span_s) and count_s <= span_s <= duration_s):
            raise InputError(
                f"--span {span_s:g} s: must be at least {count_s:.3g} s, a count of the board's timer,"
                f" and at most {duration_s:g} s, the whole motion"
            )
        return PlotView(at_s, span_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlotOptions(AnswerOptions):
    """Options for the choice, the form and the folder of pictures."""

    what: list[str] | None = option(
        "NAME,...",
        f"Pictures: {', '.join(PICTURES)}; repeatable; by default all.",
    )
    form: Literal["png", "svg", "pdf"] = option("FORMAT", "png, or as vectors svg or pdf.", "--format", default="png")
    frames: bool = switch("In-space also with the frames of base, joints and tool: x red, y green, z blue.")
    out: Path | None = option("DIR", "Folder for them; by default DIR itself.")
    replace: Replace = False

    def names(self) -> list[str]:
        """Return the names of the pictures; raise InputError for unknown ones, and for existing files."""
        names = chosen_names("--what", self.what, PICTURES) if self.what else list(PICTURES)
        if self.frames and "in-space" not in names:
            raise InputError(f"--frames: is for the picture in-space, not for {', '.join(names)}")
        if self.out is not None:
            keep_files((self.out / f"{name}.{self.form}" for name in names), replace=self.replace)
        return names


@command("out/pick", "out/pick --what edges,phases --at 2.5 --format svg")
def plot(wanted: PlotOptions, close_up: CloseUpOptions, folder: RunDir, plan: PlanDir = None) -> None:
    """Draw pictures of a stored run."""
    if not find_spec("matplotlib"):
        raise InputError(f"plot: matplotlib is not installed ({installing('plot')})")
    from steptwin.host.record.folder import read_run

    names = wanted.names()
    close_up.check_use(names)
    with naming_options(plan_folder="--plan"):
        stored = read_run(folder, plan)
    if stored.interruption:
        warn(f"{folder}: {stored.interruption}")
    view = replace(close_up.view(stored.duration_s), frames=wanted.frames)
    report = stored.report
    paths = write_plots(wanted.out or folder, names, report.run, stored.comparison, report.document, wanted.form, view)
    wanted.tell({"files": [str(path) for path in paths]}, *map(str, paths))
