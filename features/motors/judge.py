"""Judge the rotors of a run: none may slip."""

from collections.abc import Iterator
from typing import Any

from steptwin.features.motors.evidence import RotorEvidence, StoredRotors
from steptwin.features.motors.turning.after_run import RotorSlip
from steptwin.host.common.tables import Table
from steptwin.host.verify.comparison import Comparison


def reasons(rotors: RotorEvidence, _planned: None, start_counts: int) -> list[str]:
    """Return one line for each rotor that has slipped; `start_counts` is the motion's t = 0."""
    return list(map(str, rotors.slips(start_counts)))


def document(rotors: RotorEvidence, start_counts: int) -> dict[str, Any]:
    """Return the motors' part of report.json."""
    return rotors.document(start_counts)


def contradictions(rotors: RotorEvidence, comparison: Comparison) -> Iterator[str]:
    """Yield a line if stored rotors are not those of the axes: what they did shows in no count of a driver."""
    if isinstance(rotors, StoredRotors) and rotors.joints != comparison.axis_names:
        yield f"motors: those of {', '.join(rotors.joints)}, but the axes are {', '.join(comparison.axis_names)}"


def stored(rotors: RotorEvidence, _planned: None, start_counts: int) -> dict[str, Any]:
    """Return what motors.json holds: the document."""
    return rotors.document(start_counts)


def read(table: Table) -> tuple[StoredRotors, None]:
    """Return the evidence from motors.json; raise InputError for a key that is missing or of another kind."""
    table.truth("kept_step")
    joints = table.each("joints", _joint)
    slipped = tuple(slip for _, slip in joints if slip is not None)
    return StoredRotors(table.values, tuple(name for name, _ in joints), slipped), None


def _joint(table: Table) -> tuple[str, RotorSlip | None]:
    name, lost_full_steps = table.text("name"), table.number("lost_full_steps")
    if table.is_null("first_slip_s"):
        return name, None
    return name, RotorSlip(name, table.number("first_slip_s"), lost_full_steps)
