"""Harms to the bus: frames lost, disturbed, doubled or delayed, stations that leave it, and strangers on it."""

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from steptwin.emulator.faults.bus_faults import BusFault, BusFaultKind
from steptwin.emulator.faults.operations import BABBLE_COUNT_MAX, BABBLE_PERIODS_US, Babble, BusOff, StrangerSends
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.control import Do
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading, Table, integer_from, number_from
from steptwin.host.faults.frames import FRAMES, checked_identifier, cob_ids, name_of, per_node, read_identifier
from steptwin.host.faults.harms import BusRepair, HarmKind, Writer, joint_at, place
from steptwin.host.robots.robot import Robot
from steptwin.protocol.frame import COB_ID_MASK, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

_DATA_BYTES_MAX: Final = 8
"""Longest data of a frame."""
FOREVER_S: Final = 86_400.0
"""Longest time that a fault may name."""

# --- making harms


def _frames(table: Table, key: str) -> str | tuple[int, ...]:
    """Read the name of frames, or a list of identifiers."""
    if not isinstance(table.values.get(key), list):
        name = table.text(key)
        if name not in FRAMES:
            raise unknown(key, name, FRAMES)
        return name
    return tuple(sorted({checked_identifier(key, each) for each in table.elements(key)}))


def _data(table: Table, key: str) -> bytes:
    """Read the data of a frame, up to 8 bytes in hexadecimal digits."""
    text = table.text(key)
    try:
        data = bytes.fromhex(text)
    except ValueError:
        raise InputError(f"{key}: {text!r} is not bytes in hexadecimal digits, such as '0f 00'") from None
    if len(data) > _DATA_BYTES_MAX:
        raise InputError(f"{key}: {len(data)} bytes are more than {_DATA_BYTES_MAX}")
    return data


def _bus_fault(
    kind: BusFaultKind, robot: Robot, frames: str | tuple[int, ...], joint: str | None, **values: Any
) -> BusFault:
    """Return a fault of the bus; a value that is None is the one by default."""
    axis = place(robot, joint)
    if axis is not None and not (isinstance(frames, str) and per_node(frames)):
        raise InputError(f"joint: {joint} has no frames of its own among {frames}")
    by_s = values.pop("by_s", 0.0)
    ids = cob_ids(robot, frames, axis) if isinstance(frames, str) else frames
    given = {key: value for key, value in values.items() if value is not None}
    return BusFault(kind, ids, delay_counts=round(by_s * COUNTS_PER_SECOND), **given)


def _frame(values: Mapping[str, Any]) -> Frame:
    return Frame(values["id"], values["data"])


_OFTEN: Final[Mapping[str, Reading]] = {
    "frames": _frames,
    "rate": number_from(0, 1),
    "skip": integer_from(0),
    "count": integer_from(0),
}
"""Readings of how often a fault strikes."""
_FRAME: Final[Mapping[str, Reading]] = {"id": read_identifier, "data": _data}

KINDS: Final[Mapping[Do, HarmKind]] = {
    Do.STRANGER: HarmKind(lambda _, **values: StrangerSends(_frame(values)), _FRAME),
    Do.BABBLE: HarmKind(
        lambda _, **values: Babble(_frame(values), values["period_us"], values["count"]),
        {
            **_FRAME,
            "period_us": integer_from(BABBLE_PERIODS_US.start, BABBLE_PERIODS_US.stop - 1),
            "count": integer_from(0, BABBLE_COUNT_MAX),
        },
    ),
    Do.LOSS: HarmKind(partial(_bus_fault, BusFaultKind.LOSS), {**_OFTEN, "receiver": integer_from(0)}),
    Do.CORRUPTION: HarmKind(partial(_bus_fault, BusFaultKind.CORRUPTION), _OFTEN),
    Do.DUPLICATE: HarmKind(partial(_bus_fault, BusFaultKind.DUPLICATE), _OFTEN),
    Do.DELAY: HarmKind(partial(_bus_fault, BusFaultKind.DELAY), {**_OFTEN, "by_s": number_from(1e-6, FOREVER_S, "s")}),
    Do.BUS_OFF: HarmKind(lambda robot, joint: BusOff(place(robot, joint))),
    Do.BUS_OK: HarmKind(lambda _: BusRepair()),
}

# --- writing requests


def _of_frame(frame: Frame) -> dict[str, Any]:
    return {"id": frame.cob_id, "data": frame.data.hex(" ")}


def _bus_request(robot: Robot, fault: BusFault) -> dict[str, Any]:
    ids = tuple(cob_id for cob_id in range(COB_ID_MASK + 1) if cob_id in fault.cob_ids)
    name, axis = name_of(robot, ids) or (list(ids), None)
    joint = joint_at(robot, axis)
    if fault.kind is BusFaultKind.BUS_OFF:  # with a frame of its own; requests have it at once only
        return {"do": Do.BUS_OFF, "joint": joint}
    return {
        "do": Do(fault.kind.value),
        "frames": name,
        "joint": joint,
        "by_s": fault.delay_counts / COUNTS_PER_SECOND if fault.kind is BusFaultKind.DELAY else None,
        "rate": fault.rate if fault.rate < 1 else None,
        "skip": fault.skip or None,
        "count": fault.count,
        "receiver": fault.receiver,
    }


WRITERS: Final[Mapping[type, Writer]] = {
    StrangerSends: lambda _, harm: {"do": Do.STRANGER, **_of_frame(harm.frame)},
    Babble: lambda _, harm: {
        "do": Do.BABBLE,
        **_of_frame(harm.frame),
        "period_us": harm.period_us,
        "count": harm.count,
    },
    BusOff: lambda robot, harm: {"do": Do.BUS_OFF, "joint": joint_at(robot, harm.axis)},
    BusFault: _bus_request,
    BusRepair: lambda _, __: {"do": Do.BUS_OK},
}
