"""Requests of the control port: what the firmware sees of each, on two boards, in virtual time; what is refused."""

import json
from contextlib import suppress
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.drivers.axis_wires import Noise, Wire, WireState
from steptwin.emulator.operations import Operation
from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds import FAULTS
from steptwin.features.faults.kinds.bus import (
    Babble,
    BusOff,
    FrameCorruption,
    FrameDelay,
    FrameDuplicate,
    FrameLoss,
    HostBitRate,
    RogueFrame,
)
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.features.faults.kinds.machine import (
    BoardTemperature,
    BrownOut,
    EmergencyStop,
    Payload,
    PowerUp,
    SetInput,
    Slip,
    Supply,
    WatchdogReset,
)
from steptwin.features.faults.kinds.wiring import (
    BouncingSwitch,
    Contact,
    DriverMode,
    DriverProtect,
    OscCapacitor,
    SetWire,
    ShortCircuit,
    StuckSwitch,
    SwitchWire,
)
from steptwin.features.faults.requests import FRAMES as FRAME_NAMES
from steptwin.features.faults.requests import (
    INJECTED,
    REQUESTS,
    cob_ids,
    keys_of,
    metavar,
    read_request,
    request_of,
    request_of_words,
)
from steptwin.host.common.choices import STATE, Stuck
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.board_settings import Input
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.live.control_port import MachineState
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import GENERAL_INPUTS, SWITCH_INPUTS, DigitalInput, ErrorCode, State
from steptwin.protocol.frame import COB_EMCY, FIRST_NODE_ID, Frame
from tests.messages import refusing

ROBOT = replace(load_robot("lab-scara"), inputs={"box": Input("th4", 2), "door": Input("d1", 1)})
AXES = range(4)
ESTOP = {"do": "estop", "pressed": True}


class Machine:
    """The robot's four axes on two boards, enabled; the test lets time pass."""

    def __init__(self, kernel: Kernel) -> None:
        self.board = LiveBoard(ROBOT, kernel, MachineOptions(axes_per_board=(2, 2), bitrate=1_000_000))
        self.emergencies: list[tuple[int, int]] = []
        """Axis and error code of each EMCY."""
        self.board.live.view = self._hear
        self.board.live.start(0, 0)
        self.now_ns = 0
        self.wait()
        self.send(Frame(0x000, b"\x01\x00"))
        self.enable()

    def _hear(self, frame: Frame, _counts: int, _sender: object) -> None:
        axis = frame.cob_id - COB_EMCY - FIRST_NODE_ID
        if axis in AXES:
            self.emergencies.append((axis, int.from_bytes(frame.data[:2], "little")))

    def wait(self, dt_ms: int = 10) -> None:
        for _ in range(dt_ms):
            self.now_ns += 1_000_000
            self.board.live.advance(self.now_ns)

    def send(self, frame: Frame) -> None:
        self.board.live.send(frame, "a client", self.now_ns)
        self.wait()

    def enable(self) -> None:
        """Reset faults and lead all axes to OPERATION ENABLED."""
        for word in (0x00, 0x80, 0x06, 0x07, 0x0F):
            for axis in AXES:
                self.send(Frame(0x200 + FIRST_NODE_ID + axis, bytes((word, 0, 7))))
        assert self.states == [State.OPERATION_ENABLED] * 4

    def do(self, request: dict[str, Any]) -> None:
        """Do what a request asks for, as the port does."""
        operation = read_request(ROBOT, json.loads(json.dumps(request)))
        assert operation is not None
        self.board.operate(operation)
        self.wait()

    @property
    def _nodes(self) -> list[Any]:
        return [node for board in self.board.live.simulation.boards for node in board.firmware.nodes]

    @property
    def states(self) -> list[State]:
        return [node.drive.state for node in self._nodes]

    def values(self, address: int) -> list[int]:
        return [node.dictionary.get(address) for node in self._nodes]


@pytest.fixture(scope="module")
def machine(fast_kernel: Kernel) -> Machine:
    """One for all: each test undoes what it does."""
    return Machine(fast_kernel)


@pytest.mark.parametrize(
    ("request_", "undo", "axes", "inputs", "code", "shown"),
    [
        (ESTOP, {"pressed": False}, AXES, DigitalInput.ESTOP, ErrorCode.ESTOP, {"estop": True}),
        (
            {"do": "supply", "supply_v": 9.99},
            {"supply_v": 10},
            AXES,
            0,
            ErrorCode.UNDERVOLTAGE,
            {"supply_v": 9.99},
        ),
        (
            {"do": "supply", "supply_v": 34.01},
            {"supply_v": 34.0},
            AXES,
            0,
            ErrorCode.OVERVOLTAGE,
            {"supply_v": 34.01},
        ),
        (
            {"do": "temperature", "temperature_degc": 85.1},
            {"temperature_degc": 85},
            AXES,
            0,
            ErrorCode.TEMPERATURE,
            {"temperature_degc": 85.1},
        ),
        (
            {"do": "protect", "joint": "th3", "held": True},
            {"held": False},
            [2],
            DigitalInput.DRIVER_PROTECT,
            ErrorCode.TEMPERATURE,
            {"protect": {"th3": {"low": True, "held": True}}},
        ),
        (
            {"do": "input", "input": "box", "on": True},
            {"on": False},
            [3],
            DigitalInput.IN2,
            ErrorCode.NONE,
            {"inputs": {"box": True}},
        ),
        (
            {"do": "switch", "joint": "th2", "switch": "-", "stuck": "closed"},
            {"stuck": "open"},
            [1],
            DigitalInput.NEGATIVE_LIMIT,
            ErrorCode.NONE,
            {"switches": {"th2": {"-": {"closed": True, "stuck": True}}}},
        ),
        (
            {"do": "switch", "joint": "th4", "switch": "home", "stuck": "closed"},
            {"stuck": "free"},
            [3],
            DigitalInput.HOME,
            ErrorCode.NONE,
            {"switches": {"th4": {"home": {"closed": True, "stuck": True}}}},
        ),
    ],
    ids=lambda value: "-".join(map(str, value.values())) if isinstance(value, dict) and "do" in value else "",
)
def test_the_firmware_sees_it_until_its_opposite(
    machine: Machine,
    request_: dict[str, Any],
    undo: dict[str, Any],
    axes: list[int],
    inputs: int,
    code: ErrorCode,
    shown: dict[str, Any],
) -> None:
    """Its inputs, its drives' states and its EMCYs; and the state that the port shows, which is else as before."""
    before = _machine_of(machine)
    machine.emergencies.clear()
    machine.do(request_)
    assert machine.values(od.DIGITAL_INPUTS) == [inputs if axis in axes else 0 for axis in AXES]
    fault = State.FAULT if code else State.OPERATION_ENABLED
    assert machine.states == [fault if axis in axes else State.OPERATION_ENABLED for axis in AXES]
    assert machine.values(od.ERROR_CODE) == [code if axis in axes else 0 for axis in AXES]
    assert sorted(machine.emergencies) == [(axis, code) for axis in axes if code]
    assert _machine_of(machine) == _merged(before, shown)
    for axis in axes if code else []:
        machine.send(Frame(0x200 + FIRST_NODE_ID + axis, b"\x80\x00\x07"))
        assert machine.states[axis] is State.FAULT, "no fault can be reset while its cause lasts"
    machine.do(request_ | undo)
    machine.enable()
    assert machine.values(od.DIGITAL_INPUTS) == [0] * 4
    machine.do({"do": "switch", "joint": "th2", "switch": "-", "stuck": "free"})
    machine.do({"do": "supply", "supply_v": 24})
    machine.do({"do": "temperature", "temperature_degc": 25})
    assert _machine_of(machine) == before


def _machine_of(machine: Machine) -> dict[str, Any]:
    """Return the part of the state that only operations change."""
    state = MachineState(machine.board).read()
    assert json.loads(json.dumps(state)) == state
    return {
        key: state[key] for key in ("estop", "supply_v", "temperature_degc", "protect", "inputs", "switches", "robot")
    }


def _merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    return old | {key: _merged(old[key], value) if isinstance(value, dict) else value for key, value in new.items()}


def test_the_recent_load_is_that_between_two_records(machine: Machine) -> None:
    """An empty frame has 44 bits and a few stuff bits, each 1 us long; the nodes report every 100 ms by themselves."""
    loads = []
    for frames in (0, 50, 0):
        for _ in range(frames):
            machine.board.live.send(Frame(0x155, b""), "a client", machine.now_ns)
        machine.wait(100)
        machine.board.record()
        loads.append(MachineState(machine.board).read()["bus"]["recent_load_percent"])
    assert 100 * 50 * 44e-6 / 0.1 <= loads[1] - loads[2] <= 100 * 50 * 52e-6 / 0.1
    assert 0 < loads[2] < 2


def test_the_switches_are_those_of_the_file(machine: Machine) -> None:
    switches = MachineState(machine.board).read()["switches"]
    assert {joint: list(names) for joint, names in switches.items()} == {
        "d1": ["-", "+"],
        "th2": ["-", "+"],
        "th3": ["-", "+"],
        "th4": ["-", "+", "home"],
    }
    assert JointSwitches(home_to=1).inputs == JointSwitches(home_from=1).inputs == (DigitalInput.HOME,)
    assert JointSwitches().inputs == ()


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"do": 3},
        {"do": "estpo"},
        {"do": "estop"},
        {"do": "estop", "presed": True},
        ESTOP | {"pressed": 1},
        ESTOP | {"why": "x"},
        {"do": "state", "id": 7},
        {"do": "supply", "supply_v": True},
        {"do": "supply", "supply_v": -0.01},
        {"do": "supply", "supply_v": 655.36},
        {"do": "supply", "supply_v": 1e999},
        {"do": "temperature", "temperature_degc": 3276.8},
        {"do": "protect", "joint": "th5", "held": True},
        {"do": "input", "input": "boxes", "on": True},
        {"do": "switch", "joint": "d1", "switch": "home", "stuck": "open"},
        {"do": "switch", "joint": "th4", "switch": "home", "stuck": "shut"},
    ],
    ids=lambda request: " ".join(f"{value}" for value in request.values()),
)
def test_what_is_refused(request_: dict[str, Any]) -> None:
    with refusing(InputError):
        read_request(ROBOT, request_)


@pytest.mark.parametrize(
    ("request_", "operation"),
    [
        ({"do": "supply", "supply_v": 0}, Supply(0)),
        ({"do": "supply", "supply_v": 655.35}, Supply(65_535)),
        ({"do": "supply", "supply_v": 9.006}, Supply(901)),
        ({"do": "payload", "payload_kg": 0}, Payload(0)),
        ({"do": "payload", "payload_kg": 100}, Payload(100)),
        ({"do": "temperature", "temperature_degc": -3276.8}, BoardTemperature(-32_768)),
        ({"do": "temperature", "temperature_degc": 3276.7}, BoardTemperature(32_767)),
        ({"do": "state"}, None),
    ],
)
def test_what_is_just_allowed(request_: dict[str, Any], operation: Operation | None) -> None:
    assert read_request(ROBOT, request_) == operation


JOINTS = st.integers(0, 3)
FRAMES = st.one_of(
    st.sampled_from([cob_ids(ROBOT, name) for name in FRAME_NAMES]),
    st.builds(lambda axis: cob_ids(ROBOT, "records", axis), JOINTS),
    st.sets(st.integers(0, 0x7FF), min_size=1, max_size=3).map(lambda ids: tuple(sorted(ids))),
)
OFTEN = {"rate": st.floats(0, 1), "skip": st.integers(0, 9), "count": st.none() | st.integers(1, 9)}
ROGUE_FRAMES = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))
ANY_FAULT = st.one_of(
    st.builds(EmergencyStop, st.booleans()),
    st.builds(Supply, st.integers(0, 65_535)),
    st.builds(BoardTemperature, st.integers(-32_768, 32_767)),
    st.builds(DriverProtect, JOINTS, st.booleans()),
    st.builds(ShortCircuit, JOINTS, st.booleans()),
    st.builds(SetInput, st.just(3), st.just(GENERAL_INPUTS[1]), st.booleans()),
    st.builds(StuckSwitch, JOINTS, st.sampled_from(SWITCH_INPUTS[:2]), st.sampled_from([True, False, None])),
    st.builds(SetWire, JOINTS, st.sampled_from([*Wire]), st.sampled_from([*WireState])),
    st.builds(
        SetWire,
        JOINTS,
        st.sampled_from([*Wire]),
        st.builds(
            Noise, st.floats(0.5, 1000), st.integers(100, 900_000), st.none() | st.integers(1, 9), st.integers(0, 99)
        ),
    ),
    st.builds(BrownOut, st.none() | st.integers(1, 900), st.none() | JOINTS),
    st.builds(WatchdogReset, st.integers(1, 900), st.none() | JOINTS),
    st.builds(PowerUp, st.none() | JOINTS),
    st.builds(BusOff, st.none() | JOINTS),
    st.builds(HostBitRate, st.sampled_from([125_000, 250_000, 500_000, 1_000_000])),
    st.builds(RogueFrame, ROGUE_FRAMES),
    st.builds(Babble, ROGUE_FRAMES, st.integers(47, 9_999), st.integers(1, 9)),
    st.builds(FrameDuplicate, FRAMES, **OFTEN),
    st.builds(SwitchWire, JOINTS, st.sampled_from(SWITCH_INPUTS[:2]), st.sampled_from([*Contact, None])),
    st.builds(BouncingSwitch, JOINTS, st.sampled_from(SWITCH_INPUTS[:2]), st.integers(0, 9), st.integers(18, 999)),
    st.builds(DriverMode, JOINTS, st.sampled_from([1, 2, 8, 16, None])),
    st.builds(OscCapacitor, JOINTS, st.floats(64, 2000)),
    st.builds(Payload, st.floats(0, 100)),
    st.builds(Slip, JOINTS, st.sampled_from([-400, -4, 4, 8])),
    st.builds(FrameLoss, FRAMES, receiver=st.none() | st.integers(0, 2), **OFTEN),
    st.builds(FrameCorruption, FRAMES, **OFTEN),
    st.builds(FrameDelay, FRAMES, delay_counts=st.integers(100, 1 << 40), **OFTEN),
    st.builds(HostFault, st.sampled_from([HostFaultKind.DEATH, HostFaultKind.DISORDER])),
    st.builds(HostFault, st.sampled_from([HostFaultKind.HANG, HostFaultKind.RESTART]), st.floats(0, 86_400)),
    st.builds(HostFault, st.just(HostFaultKind.LATE), st.floats(1e-6, 86_400)),
)


def test_every_operation_has_a_request() -> None:
    kinds, families = [Fault], set()
    while kinds:
        kind = kinds.pop()
        kinds += kind.__subclasses__()
        if hasattr(kind, "do"):
            families.add(kind.do)
    assert families == {*FAULTS}


def test_clients_and_the_board_have_the_same_words_for_a_stuck_switch() -> None:
    assert [*Stuck] == [*keys_of("switch")["stuck"].choices]


def test_a_sensor_that_the_robots_file_does_not_know_is_told_by_its_place() -> None:
    told = request_of(ROBOT, SetInput(1, DigitalInput.IN1, on=True))
    assert told == {"do": "SetInput", "axis": 1, "input": DigitalInput.IN1, "on": True}
    json.dumps(told)


@pytest.mark.slow
@given(ANY_FAULT)
def test_a_fault_is_the_request_that_asks_for_it(fault: Fault) -> None:
    assert read_request(ROBOT, json.loads(json.dumps(request_of(ROBOT, fault)))) == fault


ASKED: dict[str, dict[str, Any]] = {
    "estop off": {"pressed": False},
    "torque-off on": {"requested": True},
    "supply 9": {"supply_v": 9},
    "temperature -20": {"temperature_degc": -20},
    "protect th2 on": {"joint": "th2", "held": True},
    "input box on": {"input": "box", "on": True},
    "switch d1 - closed": {"joint": "d1", "switch": "-", "stuck": "closed"},
    "switch-wire d1 + normally-closed": {"joint": "d1", "switch": "+", "broken": "normally-closed"},
    "bounce th4 home 5": {"joint": "th4", "switch": "home", "bounces": 5},
    "bounce th4 home 5 2000 7": {"joint": "th4", "switch": "home", "bounces": 5, "within_us": 2000, "seed": 7},
    "mode th2 8": {"joint": "th2", "microsteps": 8},
    "mode th2": {"joint": "th2"},
    "short-circuit th2 on": {"joint": "th2", "shorted": True},
    "osc th2 1000": {"joint": "th2", "osc_pf": 1000},
    "slip th2 -4": {"joint": "th2", "full_steps": -4},
    "payload 0.25": {"payload_kg": 0.25},
    "wire th2 step low": {"joint": "th2", "wire": "step", "condition": "low"},
    "wire th2 step noisy 1000 35": {
        "joint": "th2",
        "wire": "step",
        "condition": "noisy",
        "rate_hz": 1000,
        "width_us": 35,
    },
    "wire condition=low th2 enable": {"joint": "th2", "wire": "enable", "condition": "low"},
    "brown-out 5": {"for_ms": 5},
    "brown-out joint=th2": {"joint": "th2"},
    "watchdog 3 th2": {"for_ms": 3, "joint": "th2"},
    "power-up": {},
    "rogue-node 0 8112": {"id": 0, "data": "8112"},
    "babble 0x1 data= 100 9": {"id": 1, "data": "", "period_us": 100, "count": 9},
    "loss records": {"frames": "records"},
    "loss 0x510,1297 rate=0.5 receiver=0": {"frames": [0x510, 0x511], "rate": 0.5, "receiver": 0},
    "corruption all count=3": {"frames": "all", "count": 3},
    "duplicate reports th2 0.5 1 2": {"frames": "reports", "joint": "th2", "rate": 0.5, "skip": 1, "count": 2},
    "delay sync 0.1": {"frames": "sync", "by_s": 0.1},
    "sender-off reports count=1": {"frames": "reports", "count": 1},
    "bus-off th2": {"joint": "th2"},
    "bus-off host": {},
    "bit-rate 500000": {"bitrate": 500_000},
    "bus-ok": {},
    "state": {},
}
"""Words of `steptwin inject`, and the keys of the request that they ask for."""


@pytest.mark.parametrize(("words", "values"), ASKED.items())
def test_words_are_the_request_that_they_ask_for(words: str, values: dict[str, Any]) -> None:
    do, request = request_of_words(words.split())
    assert (do, request) == (words.split(maxsplit=1)[0], values)
    assert (read_request(ROBOT, {"do": do, **request}) is None) == (do == STATE)


def test_each_fault_of_a_served_board_has_words() -> None:
    """And each word that help names is one that the board knows."""
    assert {words.split()[0] for words in ASKED} == {*INJECTED} == {*REQUESTS} - {"host"}
    for do in INJECTED:
        named = [(name, metavar(key)) for name, key in keys_of(do).items() if "|" in metavar(key)]
        request = next(request for words, request in ASKED.items() if words.split()[0] == do)
        for key, words in named:
            for word in words.removeprefix("JOINT|").split("|"):
                place = {"joint": "th4"} if key == "switch" else {}
                noise = {"rate_hz": 9, "width_us": 9} if word == "noisy" else {}
                _, told = request_of_words([do, *(f"{each}={word if each == key else 1}" for each in keys_of(do))])
                read_request(ROBOT, {"do": do, **request, **place, **noise} | ({key: told[key]} if key in told else {}))


@pytest.mark.parametrize(
    "words",
    [
        "",
        "host hang",
        "wire th2 step",
        "mode th2 8 16",
        "state on",
        "loss records cuont=3",
        "loss all rate=1 rate=0",
        "loss all rate=half",
        "rogue-node 08 00",
        "protect th2 yes",
        "loss 0x510,sync",
    ],
)
def test_words_that_ask_for_nothing(words: str) -> None:
    with refusing(InputError):
        request_of_words(words.split())


WORDS = st.sampled_from([*REQUESTS, "closed", "th2", "-", "box", "", "\n"])
KEYS = st.sampled_from(["do", "pressed", "supply_v", "temperature_degc", "joint", "held", "input", "on", "switch"])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | WORDS,
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(), inner, max_size=2),
    max_leaves=3,
)


@pytest.mark.slow
@given(st.dictionaries(KEYS | st.just("stuck") | st.text(), VALUES, max_size=5), st.sampled_from([*REQUESTS]))
@example({"joint": "th4", "switch": "\ud800", "stuck": "free"}, "switch")
def test_any_object_is_an_operation_or_refused(request_: dict[str, Any], do: str) -> None:
    for each in (request_, request_ | {"do": do}):
        with suppress(InputError):
            assert isinstance(read_request(ROBOT, each), Fault | None)
