"""Read requests as harms to a robot's machine, and write harms as requests: the same words for all who ask.

The control port, `steptwin inject` and the faults of a scenario use them; `host/common/requests.py` is their table.
"""

from collections.abc import Mapping
from typing import Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.control import Do
from steptwin.host.common.requests import FORMS
from steptwin.host.common.tables import Reading, Table
from steptwin.host.faults import bus_harms, host_harms, machine_harms, wire_harms
from steptwin.host.faults.harms import Harm, HarmKind, Writer, by_fields
from steptwin.host.robots.robot import Robot

KINDS: Final[Mapping[Do, HarmKind]] = {
    **machine_harms.KINDS,
    **wire_harms.KINDS,
    **bus_harms.KINDS,
    **host_harms.KINDS,
}
"""What each kind of request becomes; `state` becomes nothing."""
WRITERS: Final[Mapping[type, Writer]] = {
    **machine_harms.WRITERS,
    **wire_harms.WRITERS,
    **bus_harms.WRITERS,
    **host_harms.WRITERS,
}
"""What writes each type of harm as a request."""


def read_request(robot: Robot, request: Mapping[str, Any]) -> Harm | None:
    """Return the harm that a request asks for; None if it only asks how the machine is.

    Raises:
        InputError: the request does not exist, has other keys or a value out of its range, or names something that the
            robot does not have.
    """
    harm, _ = read_harm(robot, Table(request, "JSON object"), {})
    return harm


def read_harm(robot: Robot, table: Table, beside: Mapping[str, Reading]) -> tuple[Harm | None, dict[str, Any]]:
    """Return the harm that a table asks for, and the values of keys that it may have beside those of the harm.

    Raises as `read_request`.
    """
    name = table.text("do")
    if name not in list(Do):
        raise unknown("do", name, Do)
    do = Do(name)
    form, kind = FORMS[do], KINDS.get(do)
    readings = {key: value.read for key, value in form.keys.items()} | dict(kind.readings if kind else {})
    required = {key: readings[key] for key in form.required}
    optional = {key: readings[key] for key in form.optional}
    values = table.read({"do": Table.text, **required}, {**optional, **beside})
    harm = None if kind is None else kind.make(robot, **{key: values[key] for key in form.keys})
    return harm, {key: values[key] for key in beside}


def request_of(robot: Robot, harm: Harm) -> dict[str, Any]:
    """Return the request that asks for a harm; `read_request` returns the harm for it."""
    write = WRITERS.get(type(harm))
    if write is None:  # no request asks for it
        return by_fields(harm)
    return {key: value for key, value in write(robot, harm).items() if value is not None}
