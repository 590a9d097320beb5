"""What rotors have done is judged, stored and read again."""

import json
from functools import partial
from types import SimpleNamespace
from typing import Any

from steptwin.features.motors.evidence import RotorFacts, RotorsSoFar, contradictions, document, read, reasons, stored
from steptwin.host.common.tables import Table, json_table
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of

LAB = load_robot("lab-scara")
START_COUNTS = 72_000_000
SEEN = RotorsSoFar(
    LAB,
    tuple(
        RotorFacts(
            name, 40.5, 2 * START_COUNTS, 3 * START_COUNTS if name == "th2" else None, -8.0 * (name == "th2"), 26.0
        )
        for name in LAB.axis_names
    ),
)
SAID = "th2: its rotor slips at 2.000 s and ends 8 full steps away"


def table(**changes: object) -> Table:
    """Return a stored document of these rotors, with changes."""
    return json_table(json.dumps(stored(SEEN, None, START_COUNTS) | changes))


def test_a_rotor_that_slips_is_a_reason() -> None:
    """Times are the motion's."""
    assert reasons(SEEN, None, START_COUNTS) == [SAID]
    told = document(SEEN, START_COUNTS)
    assert (told["kept_step"], told["supply_v"]) == (False, 24.0)
    assert told["joints"][1] == {
        "name": "th2",
        "load_angle_deg": 40.5,
        "load_angle_at_s": 1.0,
        "first_slip_s": 2.0,
        "lost_full_steps": -8.0,
        "winding_celsius": 26.0,
    }
    assert told["joints"][0]["first_slip_s"] is None


def test_what_is_stored_is_read_again() -> None:
    seen, planned = read(table())
    assert planned is None
    assert document(seen, 0) == document(SEEN, START_COUNTS)
    assert reasons(seen, None, 0) == [SAID]


def test_rotors_of_other_axes_are_told() -> None:
    seen, _ = read(table())
    same: Any = SimpleNamespace(axis_names=LAB.axis_names)
    other: Any = SimpleNamespace(axis_names=("x", "y"))
    assert list(contradictions(seen, same)) == []
    assert list(contradictions(seen, other)) == ["motors: those of d1, th2, th3, th4, but the axes are x, y"]


def test_what_is_wrong_in_a_file_is_told() -> None:
    for changes, line in (
        ({"kept_step": "yes"}, "kept_step: "),
        ({"joints": [{"name": "th1"}]}, "joints[0]: lost_full_steps: "),
        ({"joints": [{"name": "th1", "lost_full_steps": 0, "first_slip_s": "never"}]}, "joints[0]: first_slip_s: "),
    ):
        assert line in complaint_of(partial(read, table(**changes)))
