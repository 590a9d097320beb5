"""Read requests as harms to a robot's machine, and write harms as requests: one table for all who ask.

The control port, `steptwin inject` and the faults of a scenario use the same words.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, Final, NamedTuple

from steptwin.emulator.bus_faults import BusFault, BusFaultKind
from steptwin.emulator.operations import (
    BABBLE_PERIOD_MIN_US,
    CYCLE_FULL_STEPS,
    PAYLOAD_MAX_KG,
    RESET_MS,
    SUPPLIES_10MV,
    TEMPERATURES_DECIDEGC,
    WITHIN_US,
    Babble,
    BoardTemperature,
    BouncingSwitch,
    BrownOut,
    BusOff,
    Contact,
    DriverMode,
    DriverProtect,
    EmergencyStop,
    OscCapacitor,
    Payload,
    PowerUp,
    SetInput,
    SetWire,
    Slip,
    StrangerSends,
    StuckSwitch,
    Supply,
    SwitchWire,
    WatchdogReset,
)
from steptwin.emulator.tb6560 import OSC_PF_MIN, Excitation
from steptwin.emulator.wires import NOISE_RATE_MAX_HZ, Noise, Wire, WireState
from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.control import SWITCHES, Do, Stuck, SwitchWiring, Wiring
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading, Table
from steptwin.host.operate.input_waiting import wired_inputs
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.control.frames import FRAMES, cob_ids, name_of, per_node
from steptwin.host.twin.input_changes import set_input
from steptwin.host.twin.scenarios.harms import BusRepair, Harm, HostFault, HostFaultKind
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import COB_ID_MASK, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

PER_V: Final = 100
PER_DEGC: Final = 10
"""Parts of a volt and of a degree in which the board measures."""
FULL_STEPS_MAX: Final = 100_000
"""Greatest number of full steps by which a motor slips."""
_LEVELS: Final = {Stuck.CLOSED: True, Stuck.OPEN: False, Stuck.FREE: None}
_CONTACTS: Final = {
    SwitchWiring.WHOLE: None,
    SwitchWiring.NORMALLY_OPEN: Contact.NORMALLY_OPEN,
    SwitchWiring.NORMALLY_CLOSED: Contact.NORMALLY_CLOSED,
}
_STUCK: Final = {closed: stuck for stuck, closed in _LEVELS.items()}
_SWITCH_NAMES: Final = {bit: name for name, bit in SWITCHES.items()}


def _whole(parts: range, per_unit: int, unit: str) -> Reading:
    """Return the reading of a number as a whole number of parts of its unit, within a range of these."""
    lower, upper = parts.start / per_unit, (parts.stop - 1) / per_unit

    def read(table: Table, key: str) -> int:
        value = table.number(key)
        if not lower <= value <= upper:
            nearest = nearest_within(value, lower, upper, unit)
            raise InputError(f"{key}: {outside(value, lower, upper, unit)}{nearest}")
        return round(value * per_unit)

    return read


def _number(lower: float, upper: float, unit: str) -> Reading:
    """Return the reading of a number within a range."""

    def read(table: Table, key: str) -> float:
        value = table.number(key)
        if not lower <= value <= upper:
            nearest = nearest_within(value, lower, upper, unit)
            raise InputError(f"{key}: {outside(value, lower, upper, unit)}{nearest}")
        return value

    return read


def _count(table: Table, key: str) -> int:
    """Read a whole number from 0 on."""
    value = table.integer(key)
    if value < 0:
        raise InputError(f"{key}: {value} is below 0")
    return value


def _cycles(table: Table, key: str) -> int:
    """Read full steps that make whole electrical cycles."""
    full_steps = table.integer(key, FULL_STEPS_MAX)
    if not full_steps or full_steps % CYCLE_FULL_STEPS:
        near = CYCLE_FULL_STEPS * max(1, round(abs(full_steps) / CYCLE_FULL_STEPS))
        raise InputError(
            f"{key}: {full_steps} is not a multiple of {CYCLE_FULL_STEPS}: a motor slips by whole electrical cycles;"
            f" the nearest is {near if full_steps >= 0 else -near}"
        )
    return full_steps


def _frames(table: Table, key: str) -> str | tuple[int, ...]:
    """Read the name of frames, or a list of identifiers."""
    if not isinstance(table.values.get(key), list):
        name = table.text(key)
        if name not in FRAMES:
            raise unknown(key, name, FRAMES)
        return name
    ids = table.elements(key)
    for each in ids:
        if isinstance(each, bool) or not isinstance(each, int) or not 0 <= each <= COB_ID_MASK:
            raise InputError(f"{key}: {each!r} is not an identifier from 0 to 0x{COB_ID_MASK:X}")
    return tuple(sorted({each for each in ids if isinstance(each, int)}))


def _from(least: int) -> Reading:
    """Return the reading of a whole number from one on."""

    def read(table: Table, key: str) -> int:
        value = table.integer(key)
        if value < least:
            raise InputError(f"{key}: {value} is below {least}")
        return value

    return read


def _microsteps(table: Table, key: str) -> int:
    value = table.integer(key)
    if value not in [*Excitation]:
        raise InputError(f"{key}: {value} is not one of {', '.join(str(int(each)) for each in Excitation)}")
    return value


def _cob_id(table: Table, key: str) -> int:
    """Read an identifier of 11 bits."""
    value = table.integer(key)
    if not 0 <= value <= COB_ID_MASK:
        raise InputError(f"{key}: {value} is not an identifier from 0 to 0x{COB_ID_MASK:X}")
    return value


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


def _place(robot: Robot, values: Mapping[str, Any]) -> int | None:
    return None if values["joint"] is None else robot.index_of(values["joint"])


_DATA_BYTES_MAX: Final = 8
"""Longest data of a frame."""
_DOWN_KEYS: Final[Mapping[str, Reading]] = {"for_ms": _from(1), "joint": Table.text}
"""Keys of what takes a board down."""
_FOREVER_S: Final = 86_400.0
"""Longest time that a fault may name."""
_FRAME_KEYS: Final[Mapping[str, Reading]] = {
    "joint": Table.text,
    "rate": _number(0, 1, ""),
    "skip": _count,
    "count": _count,
}
"""Keys that each fault of the bus may have."""


_NOISE_KEYS: Final[Mapping[str, Reading]] = {
    "rate_hz": _number(0, NOISE_RATE_MAX_HZ, "Hz"),
    "width_us": _number(0.1, 1e6, "us"),
    "count": _count,
    "seed": _count,
}
"""Keys of a noisy wire, the first two required."""


class _Kind(NamedTuple):
    """A kind of request: its keys beside `do`, those that may be missing, and what it asks for, made of their values.

    A key that is missing has the value None.
    """

    keys: Mapping[str, Reading]
    make: Callable[[Robot, dict[str, Any]], Harm | None]
    optional: Mapping[str, Reading] = {}


_KINDS: Final[Mapping[Do, _Kind]] = {
    Do.ESTOP: _Kind({"pressed": Table.truth}, lambda _, values: EmergencyStop(values["pressed"])),
    Do.SUPPLY: _Kind(
        {"supply_v": _whole(SUPPLIES_10MV, PER_V, "V")},
        lambda _, values: Supply(values["supply_v"]),
    ),
    Do.TEMPERATURE: _Kind(
        {"temperature_degc": _whole(TEMPERATURES_DECIDEGC, PER_DEGC, "degC")},
        lambda _, values: BoardTemperature(values["temperature_degc"]),
    ),
    Do.PROTECT: _Kind(
        {"joint": Table.text, "held": Table.truth},
        lambda robot, values: DriverProtect(robot.index_of(values["joint"]), values["held"]),
    ),
    Do.INPUT: _Kind(
        {"input": Table.text, "on": Table.truth},
        lambda robot, values: set_input(robot, values["input"], on=values["on"]),
    ),
    Do.SWITCH: _Kind(
        {"joint": Table.text, "switch": Table.text, "stuck": lambda table, key: table.choice(key, Stuck)},
        lambda robot, values: _stuck_switch(robot, **values),
    ),
    Do.SWITCH_WIRE: _Kind(
        {
            "joint": Table.text,
            "switch": Table.text,
            "broken": lambda table, key: table.choice(key, SwitchWiring),
        },
        lambda robot, values: SwitchWire(
            *_switch_at(robot, values["joint"], values["switch"]), _CONTACTS[values["broken"]]
        ),
    ),
    Do.BOUNCE: _Kind(
        {"joint": Table.text, "switch": Table.text, "bounces": _count},
        lambda robot, values: _bouncing(robot, **values),
        {"within_us": _from(1), "seed": _count},
    ),
    Do.MODE: _Kind(
        {"joint": Table.text},
        lambda robot, values: DriverMode(robot.index_of(values["joint"]), values["microsteps"]),
        {"microsteps": _microsteps},
    ),
    Do.OSC: _Kind(
        {"joint": Table.text, "osc_pf": _number(OSC_PF_MIN, 1e6, "pF")},
        lambda robot, values: OscCapacitor(robot.index_of(values["joint"]), values["osc_pf"]),
    ),
    Do.SLIP: _Kind(
        {"joint": Table.text, "full_steps": _cycles},
        lambda robot, values: Slip(robot.index_of(values["joint"]), values["full_steps"]),
    ),
    Do.PAYLOAD: _Kind(
        {"payload_kg": _number(0, PAYLOAD_MAX_KG, "kg")}, lambda _, values: Payload(values["payload_kg"])
    ),
    Do.WIRE: _Kind(
        {
            "joint": Table.text,
            "wire": lambda table, key: table.choice(key, Wire),
            "condition": lambda table, key: table.choice(key, Wiring),
        },
        lambda robot, values: _set_wire(robot, **values),
        _NOISE_KEYS,
    ),
    Do.BROWN_OUT: _Kind({}, lambda robot, values: BrownOut(values["for_ms"], _place(robot, values)), _DOWN_KEYS),
    Do.WATCHDOG: _Kind(
        {}, lambda robot, values: WatchdogReset(values["for_ms"] or RESET_MS, _place(robot, values)), _DOWN_KEYS
    ),
    Do.POWER_UP: _Kind({}, lambda robot, values: PowerUp(_place(robot, values)), {"joint": Table.text}),
    Do.STRANGER: _Kind(
        {"id": _cob_id, "data": _data}, lambda _, values: StrangerSends(Frame(values["id"], values["data"]))
    ),
    Do.BABBLE: _Kind(
        {"id": _cob_id, "data": _data, "period_us": _from(BABBLE_PERIOD_MIN_US), "count": _from(1)},
        lambda _, values: Babble(Frame(values["id"], values["data"]), values["period_us"], values["count"]),
    ),
    Do.LOSS: _Kind(
        {"frames": _frames},
        lambda robot, values: _bus_fault(robot, BusFaultKind.LOSS, **values),
        {**_FRAME_KEYS, "receiver": _count},
    ),
    Do.CORRUPTION: _Kind(
        {"frames": _frames},
        lambda robot, values: _bus_fault(robot, BusFaultKind.CORRUPTION, **values),
        _FRAME_KEYS,
    ),
    Do.DUPLICATE: _Kind(
        {"frames": _frames},
        lambda robot, values: _bus_fault(robot, BusFaultKind.DUPLICATE, **values),
        _FRAME_KEYS,
    ),
    Do.DELAY: _Kind(
        {"frames": _frames, "by_s": _number(1e-6, _FOREVER_S, "s")},
        lambda robot, values: _bus_fault(robot, BusFaultKind.DELAY, **values),
        _FRAME_KEYS,
    ),
    Do.BUS_OFF: _Kind({}, lambda robot, values: BusOff(_place(robot, values)), {"joint": Table.text}),
    Do.BUS_OK: _Kind({}, lambda _, __: BusRepair()),
    Do.HOST: _Kind(
        {"how": lambda table, key: table.choice(key, HostFaultKind)},
        lambda _, values: _host_fault(**values),
        {"by_s": _number(0, _FOREVER_S, "s")},
    ),
    Do.STATE: _Kind({}, lambda _, __: None),
}


def keys_of(do: Do) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the keys that a kind of request must have beside `do`, and those that it may have."""
    kind = _KINDS[do]
    return tuple(kind.keys), tuple(kind.optional)


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
    kind = _KINDS[Do(name)]
    values = table.read({"do": Table.text, **kind.keys}, {**kind.optional, **beside})
    own = {key: values[key] for key in (*kind.keys, *kind.optional)}
    return kind.make(robot, own), {key: values[key] for key in beside}


def _set_wire(robot: Robot, joint: str, wire: Wire, condition: Wiring, **noise: Any) -> SetWire:
    axis = robot.index_of(joint)
    if condition is Wiring.NOISY:
        return SetWire(axis, wire, _noise(**noise))
    if given := [key for key, value in noise.items() if value is not None]:
        raise InputError(f"{given[0]}: is for a noisy wire, not for one that is {condition}")
    return SetWire(axis, wire, WireState(condition))


def _noise(rate_hz: float | None, width_us: float | None, count: int | None, seed: int | None) -> Noise:
    if rate_hz is None or width_us is None:
        missing = "rate_hz" if rate_hz is None else "width_us"
        raise InputError(f"{missing}: is missing: a noisy wire has rate_hz and width_us")
    try:
        return Noise(rate_hz, round(1000 * width_us), count, seed or 0)
    except ValueError as error:
        raise InputError(str(error)) from error


def _wire_request(robot: Robot, operation: SetWire) -> dict[str, Any]:
    request = {"do": Do.WIRE, "joint": robot.joint_names[operation.axis], "wire": operation.wire}
    noise = operation.condition
    if not isinstance(noise, Noise):
        return {**request, "condition": noise.value}
    return {
        **request,
        "condition": Wiring.NOISY,
        "rate_hz": noise.rate_hz,
        "width_us": noise.width_ns / 1000,
        **({} if noise.count is None else {"count": noise.count}),
        **({"seed": noise.seed} if noise.seed else {}),
    }


def _bus_fault(
    robot: Robot, kind: BusFaultKind, frames: str | tuple[int, ...], joint: str | None, **values: Any
) -> BusFault:
    """Return a fault of the bus; a value that is None is the one by default."""
    axis = None if joint is None else robot.index_of(joint)
    if axis is not None and not (isinstance(frames, str) and per_node(frames)):
        raise InputError(f"joint: {joint} has no frames of its own among {frames}")
    by_s = values.pop("by_s", 0.0)
    ids = cob_ids(robot, frames, axis) if isinstance(frames, str) else frames
    given = {key: value for key, value in values.items() if value is not None}
    return BusFault(kind, ids, delay_counts=round(by_s * COUNTS_PER_SECOND), **given)


def switches_of(robot: Robot, axis: int) -> dict[str, DigitalInput]:
    """Return the switches that a joint has, by the names that requests give them."""
    fitted = robot.joints[axis].switches.inputs
    return {name: bit for name, bit in SWITCHES.items() if bit in fitted}


def _stuck_switch(robot: Robot, joint: str, switch: str, stuck: Stuck) -> StuckSwitch:
    return StuckSwitch(*_switch_at(robot, joint, switch), _LEVELS[stuck])


def _switch_at(robot: Robot, joint: str, switch: str) -> tuple[int, DigitalInput]:
    """Return the axis and the input of a joint's switch; raise InputError if it has no such switch."""
    axis = robot.index_of(joint)
    fitted = switches_of(robot, axis)
    if switch not in fitted:
        raise unknown(f"switch of {joint}", switch, fitted)
    return axis, fitted[switch]


def _bouncing(
    robot: Robot, joint: str, switch: str, bounces: int, within_us: int | None, seed: int | None
) -> BouncingSwitch:
    axis, which = _switch_at(robot, joint, switch)
    try:
        return BouncingSwitch(axis, which, bounces, within_us or WITHIN_US, seed or 0)
    except ValueError as error:
        raise InputError(str(error)) from error


def _host_fault(how: HostFaultKind, by_s: float | None) -> HostFault:
    try:
        return HostFault(how, by_s or 0.0)
    except ValueError as error:
        raise InputError(str(error)) from error


def _down(for_ms: int | None) -> dict[str, int]:
    return {} if for_ms is None else {"for_ms": for_ms}


def _joint(robot: Robot, axis: int | None) -> dict[str, str]:
    return {} if axis is None else {"joint": robot.joint_names[axis]}


def _frame(frame: Frame) -> dict[str, Any]:
    return {"id": frame.cob_id, "data": frame.data.hex(" ")}


def request_of(robot: Robot, harm: Harm) -> dict[str, Any]:
    """Return the request that asks for a harm; `read_request` returns the harm for it."""
    return REQUESTS.get(type(harm), _by_fields)(robot, harm)


def _by_fields(_robot: Robot, harm: Any) -> dict[str, Any]:
    """Name an operation that no request asks for."""
    return {"do": type(harm).__name__, **asdict(harm)}


def _input_request(robot: Robot, operation: SetInput) -> dict[str, Any]:
    place = operation.axis, operation.input
    name = next((name for name, wired in wired_inputs(robot).items() if wired == place), None)
    if name is None:  # the robot's file does not know of the sensor
        return _by_fields(robot, operation)
    return {"do": Do.INPUT, "input": name, "on": operation.on}


def _of_switch(robot: Robot, operation: SwitchWire | BouncingSwitch) -> dict[str, str]:
    return {"joint": robot.joint_names[operation.axis], "switch": _SWITCH_NAMES[operation.switch]}


def _switch_request(robot: Robot, operation: StuckSwitch) -> dict[str, Any]:
    joint, switch = robot.joint_names[operation.axis], _SWITCH_NAMES[operation.switch]
    return {"do": Do.SWITCH, "joint": joint, "switch": switch, "stuck": _STUCK[operation.closed]}


def _bus_request(robot: Robot, fault: BusFault) -> dict[str, Any]:
    ids = tuple(cob_id for cob_id in range(COB_ID_MASK + 1) if cob_id in fault.cob_ids)
    name, axis = name_of(robot, ids) or (list(ids), None)
    joint = {} if axis is None else {"joint": robot.joint_names[axis]}
    if fault.kind is BusFaultKind.BUS_OFF:  # with a frame of its own; requests have it at once only
        return {"do": Do.BUS_OFF, **joint}
    return {
        "do": Do(fault.kind.value),
        "frames": name,
        **joint,
        **({"by_s": fault.delay_counts / COUNTS_PER_SECOND} if fault.kind is BusFaultKind.DELAY else {}),
        **({"rate": fault.rate} if fault.rate < 1 else {}),
        **({"skip": fault.skip} if fault.skip else {}),
        **({} if fault.count is None else {"count": fault.count}),
        **({} if fault.receiver is None else {"receiver": fault.receiver}),
    }


REQUESTS: Final[Mapping[type, Callable[[Robot, Any], dict[str, Any]]]] = {
    EmergencyStop: lambda _, harm: {"do": Do.ESTOP, "pressed": harm.pressed},
    Supply: lambda _, harm: {"do": Do.SUPPLY, "supply_v": harm.supply_10mv / PER_V},
    BoardTemperature: lambda _, harm: {
        "do": Do.TEMPERATURE,
        "temperature_degc": harm.temperature_decidegc / PER_DEGC,
    },
    DriverProtect: lambda robot, harm: {
        "do": Do.PROTECT,
        "joint": robot.joint_names[harm.axis],
        "held": harm.active,
    },
    SetInput: _input_request,
    StuckSwitch: _switch_request,
    Slip: lambda robot, harm: {
        "do": Do.SLIP,
        "joint": robot.joint_names[harm.axis],
        "full_steps": harm.full_steps,
    },
    Payload: lambda _, harm: {"do": Do.PAYLOAD, "payload_kg": harm.payload_kg},
    SetWire: _wire_request,
    SwitchWire: lambda robot, harm: {
        "do": Do.SWITCH_WIRE,
        **_of_switch(robot, harm),
        "broken": SwitchWiring.WHOLE if harm.broken is None else harm.broken.value,
    },
    BouncingSwitch: lambda robot, harm: {
        "do": Do.BOUNCE,
        **_of_switch(robot, harm),
        "bounces": harm.bounces,
        "within_us": harm.within_us,
        **({"seed": harm.seed} if harm.seed else {}),
    },
    DriverMode: lambda robot, harm: {
        "do": Do.MODE,
        **_joint(robot, harm.axis),
        **({} if harm.microsteps is None else {"microsteps": harm.microsteps}),
    },
    OscCapacitor: lambda robot, harm: {"do": Do.OSC, **_joint(robot, harm.axis), "osc_pf": harm.osc_pf},
    BrownOut: lambda robot, harm: {"do": Do.BROWN_OUT, **_down(harm.for_ms), **_joint(robot, harm.axis)},
    WatchdogReset: lambda robot, harm: {"do": Do.WATCHDOG, **_down(harm.for_ms), **_joint(robot, harm.axis)},
    PowerUp: lambda robot, harm: {"do": Do.POWER_UP, **_joint(robot, harm.axis)},
    StrangerSends: lambda _, harm: {"do": Do.STRANGER, **_frame(harm.frame)},
    Babble: lambda _, harm: {
        "do": Do.BABBLE,
        **_frame(harm.frame),
        "period_us": harm.period_us,
        "count": harm.count,
    },
    BusOff: lambda robot, harm: {"do": Do.BUS_OFF, **_joint(robot, harm.axis)},
    BusFault: _bus_request,
    BusRepair: lambda _, __: {"do": Do.BUS_OK},
    HostFault: lambda _, harm: {"do": Do.HOST, "how": harm.kind, "by_s": harm.by_s},
}
"""What writes each type of harm as a request."""
