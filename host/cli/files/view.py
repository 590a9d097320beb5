"""`steptwin view DIR`: a stored run in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import naming_options
from steptwin.host.cli.live.panel_process import require_extra
from steptwin.host.cli.output import say
from steptwin.host.cli.run.verify import PlanDir, RunDir


@command("out/drawer-pull", "out/today out/yesterday")
def view(
    folder: RunDir,
    other: Annotated[
        Path | None, typer.Argument(metavar="[DIR_B]", help="Another run of the robot, shown beside the first.")
    ] = None,
    plan: PlanDir = None,
    port: Annotated[
        int | None, typer.Option(metavar="PORT", help="Port of the page; by default 8090, or a free one; 0 is free.")
    ] = None,
) -> None:
    """Replay a stored run in a browser, until Ctrl-C: arm, joints, pins, currents and marks at any instant.

    With two runs, both arms are shown and how far they are apart. Only this machine reaches the page.
    """
    require_extra()
    from steptwin.host.panel.replay.page import serve_replay

    folders = (folder,) if other is None else (folder, other)
    with naming_options("port", plan_folder="--plan"):
        serve_replay(folders, plan, port, lambda url: say(f"view: {url}", "Ctrl-C ends it"))
