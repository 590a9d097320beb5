"""Serve stored runs in a browser, to this machine only."""

from collections.abc import Callable
from pathlib import Path

from steptwin.host.panel.page.replay.page import ReplayPage
from steptwin.host.panel.page.server import Address, open_port, serve_page
from steptwin.host.panel.replay import Replay, RunPair


def serve_replay(
    folders: tuple[Path, ...], plan_folder: Path | None, port: int | None, announce: Callable[[str], None]
) -> None:
    """Serve one run, or two side by side, until Ctrl-C.

    Args:
        folders: one or two folders of runs.
        plan_folder: as for `read_run`, for the first of them.
        port: TCP port; None takes the usual one, or a free one if it is in use; 0 takes a free one.
        announce: called with the page's URL when browsers can open it.

    Raises:
        InputError: as `Replay.of_folder` and `RunPair` do.
        BusError: the port is in use.
    """
    with open_port(Address(port=port)) as listener:
        plans = (plan_folder, *(None for _ in folders[1:]))
        replays = tuple(Replay.of_folder(*each) for each in zip(folders, plans, strict=True))
        if len(replays) == 2:
            RunPair(*replays)
        names = " and ".join(f"{replay.run.report.run.robot} {replay.run.report.run.job}" for replay in replays)

        def build() -> None:
            ReplayPage(replays)

        serve_page(build, listener, f"{names} – StepTwin", announce)
