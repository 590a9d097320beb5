"""Print the state of each axis, as stop, estop, reset and home leave it."""

from dataclasses import asdict
from importlib.util import find_spec
from typing import TYPE_CHECKING

from steptwin.host.cli.output import fixed, print_json, print_table
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.recovering import AxisState
    from steptwin.host.robots.robot import Robot


def require_extra() -> None:
    """Raise InputError, with the remedy, unless the extra `panel` is installed."""
    if find_spec("nicegui") is None:
        raise InputError("the panel is not installed: pip install 'steptwin[panel]'")


def print_axis_states(
    robot: "Robot", states: "list[AxisState]", *, positions: bool = True, as_json: bool = False
) -> None:
    """Print one JSON document, or a table; without `positions` the states alone, and null in the document."""
    if as_json:
        unknown = {} if positions else {"position": None, "position_known": False}
        print_json({"robot": robot.name, "axes": [asdict(state) | unknown for state in states]})
        return
    columns = ["axis", "state", "known", "position"][: None if positions else 2]
    rows = [
        [state.name, state.state, "yes" if state.position_known else "no", fixed(state.position)][: len(columns)]
        for state in states
    ]
    print_table(columns, rows, text_columns=min(3, len(columns)))
