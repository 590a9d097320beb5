"""What motors say on a served board: which rotors have slipped, and what they have done in the end."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from steptwin.features.motors.evidence import RotorsSoFar
from steptwin.host.cli.output import Columns, print_rows


def banner() -> str:
    """Return that the motors turn."""
    return "motors turn with it ([A] masses)"


def warnings(seen: RotorsSoFar) -> Iterator[str]:
    """Yield a line for each rotor that has slipped: without encoders the board does not know it."""
    for slip in seen.slips(0):
        yield f"{slip.name}: its rotor has slipped, {slip.at_s:.3f} s after power-up; homing finds the position again"


_ROTORS: Final[Columns] = {
    "motor": "{0[name]}",
    "load angle deg": "{0[load_angle_deg]:.1f}",
    "at s": "{0[load_angle_at_s]:.3f}",
    "first slip s": lambda joint: "-" if joint["first_slip_s"] is None else f"{joint['first_slip_s']:.3f}",
    "lost steps": "{0[lost_full_steps]:g}",
    "winding degC": "{0[winding_celsius]:.1f}",
}


def print_report(document: Mapping[str, Any]) -> None:
    """Print a row for each motor."""
    print_rows(_ROTORS, document["joints"])
