"""`steptwin plot DIR`: draw pictures of a stored run."""

from dataclasses import dataclass
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, Replace, chosen_names, keep_files, naming_options
from steptwin.host.cli.option_groups import given_options
from steptwin.host.cli.output import say, tell, warn
from steptwin.host.cli.run.verify import PlanDir, RunDir
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.record.plots import PlotView


@dataclass(frozen=True, slots=True)
class CloseUpOptions:
    """The options that choose what pictures of a short time show."""

    at_s: Annotated[
        float | None,
        typer.Option("--at", metavar="SECONDS", help="For edges and phases: their middle; by default the fastest."),
    ] = None
    span_s: Annotated[
        float | None,
        typer.Option("--span", metavar="SECONDS", help="For edges and phases: their width; by default some steps."),
    ] = None

    def check_use(self, names: list[str]) -> None:
        """Raise InputError if an option is given for pictures that show all of the motion."""
        from steptwin.host.record.plots import CLOSE_UPS

        given = given_options(self)
        if given and not set(names) & set(CLOSE_UPS):
            raise InputError(f"{given[0]}: is for the pictures {' and '.join(CLOSE_UPS)}, not for {', '.join(names)}")

    def view(self, duration_s: float) -> "PlotView":
        """Return the time that the pictures show; raise InputError unless it is in the motion."""
        from steptwin.host.record.plots import PlotView
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


@command("out/drawer-pull", "out/drawer-pull --what edges,phases --at 2.5 --format svg")
def plot(
    close_up: CloseUpOptions,
    folder: RunDir,
    what: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...",
            help="Pictures: joints, step-rates, tool-path, tool-pose, error, timing, jitter, widths, edges, phases;"
            " repeatable; by default all.",
        ),
    ] = None,
    form: Annotated[
        Literal["png", "svg", "pdf"], typer.Option("--format", metavar="FORMAT", help="png, or as vectors svg or pdf.")
    ] = "png",
    plan: PlanDir = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for them; by default DIR itself.")] = None,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Draw pictures of a stored run."""
    if not find_spec("matplotlib"):
        raise InputError("plot: matplotlib is not installed (pip install 'steptwin[plot]')")
    from steptwin.host.record.folder import read_run
    from steptwin.host.record.plots import write_plots

    names = _names(what)
    close_up.check_use(names)
    if out is not None:
        keep_files((out / f"{name}.{form}" for name in names), replace=replace)
    with naming_options(plan_folder="--plan"):
        stored = read_run(folder, plan)
    if stored.interruption:
        warn(f"{folder}: {stored.interruption}")
    view = close_up.view(stored.duration_s)
    paths = write_plots(out or folder, stored.comparison, stored.report.run, names, form, view)
    tell({"files": [str(path) for path in paths]}, lambda: say(*map(str, paths)), as_json=as_json)


def _names(what: list[str] | None) -> list[str]:
    from steptwin.host.record.plots import PICTURES

    return chosen_names("--what", what, PICTURES) if what else list(PICTURES)
