"""Print the state of each axis, as stop, estop, reset and home leave it."""

from dataclasses import asdict
from typing import TYPE_CHECKING

from steptwin.host.cli.output import print_json, print_table

if TYPE_CHECKING:
    from steptwin.host.operate.recovering import AxisState
    from steptwin.host.robots.robot import Robot


def print_axis_states(robot: "Robot", states: "list[AxisState]", *, as_json: bool) -> None:
    """Print one JSON document, or a table."""
    if as_json:
        print_json({"robot": robot.name, "axes": [asdict(state) for state in states]})
        return
    rows = [
        [state.name, state.state, "yes" if state.position_known else "no", f"{state.position:.4f}"] for state in states
    ]
    print_table(["axis", "state", "known", "position"], rows, text_columns=3)
