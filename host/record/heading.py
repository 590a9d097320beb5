"""Name a run above its pictures."""

from steptwin.host.common.bad_input import shortened
from steptwin.host.common.printable import printable
from steptwin.host.verify import RunInfo


def heading(run: RunInfo, *what: str) -> str:
    """Return robot, job and what is shown of them, and that the run is simulated."""
    return f"{' · '.join((printable(shortened(run.robot)), printable(shortened(run.job)), *what))} (SIMULATED)"
