"""`steptwin view DIR`: show a stored run in a browser."""

from pathlib import Path

from steptwin.features.panel.options import require_extra
from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import PlanDir, RunDir
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.output import say


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
