"""Checks of a drive (CiA 402-2): state machine, modes, option codes, and with leave a small motion."""

from typing import Final

from steptwin.features.conform.check import DiffersError, Need, SkippedError, expect, group
from steptwin.features.conform.node import CONTROLWORD, MODE, MODE_DISPLAY, STATUSWORD, NodeUnderTest, said
from steptwin.protocol import od
from steptwin.protocol.cia402 import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    SHUTDOWN,
    SWITCH_ON,
    Control,
    Mode,
    State,
)
from steptwin.protocol.sdo_frames import AbortCode

check = group("drive")

_SUPPORTED: Final = od.address_of(0x6502)
_TARGET: Final = od.address_of(0x607A)
_POSITION: Final = od.address_of(0x6064)
_QUICK_STOP: Final = od.address_of(0x605A)
_OPTIONS: Final = {0x605A: 99, 0x605B: 99, 0x605C: 99, 0x605D: 99, 0x605E: 99, 0x6007: 99}
"""Option codes, each with a value that no drive has."""
_ACKNOWLEDGE: Final = 1 << 12
_REACHED: Final = 1 << 10
_MOTION_S: Final = 10.0
_OTHER_MODE: Final = 63
_SUPPORT_BITS: Final = {1: 0, 2: 1, 3: 2, 4: 3, 6: 5, 7: 6, 8: 7, 9: 8, 10: 9}
"""Bit of 6502h of each mode."""
_STILL: Final = (Mode.PROFILE_POSITION, Mode.PROFILE_VELOCITY)


def _needs_drive(node: NodeUnderTest) -> None:
    if not node.is_drive:
        raise SkippedError("0x1000 says that it is no drive")


def _without_motion(node: NodeUnderTest) -> None:
    """Choose a mode that does not move by itself when the drive is switched on."""
    supported = node.number(_SUPPORTED)
    for mode in _STILL:
        if supported >> _SUPPORT_BITS[mode] & 1:
            if mode is Mode.PROFILE_VELOCITY:
                node.download(od.address_of(0x60FF), bytes(4))
            node.download(MODE, bytes((mode,)))
            return
    raise SkippedError("neither profile position nor profile velocity")


def _lead(node: NodeUnderTest, *steps: tuple[int, State]) -> None:
    for word, state in steps:
        node.control(word)
        expect(node.reached(state), f"{word:04X}h leads to {node.drive_state().name}, not {state.name}")


@check("F1", "6040h, 6041h", "06h, 07h, 0Fh, 07h, 06h, 00h lead through the states", Need.ENABLE)
def states(node: NodeUnderTest) -> None:
    _needs_drive(node)
    node.switched_off()
    _without_motion(node)
    _lead(
        node,
        (SHUTDOWN, State.READY_TO_SWITCH_ON),
        (SWITCH_ON, State.SWITCHED_ON),
        (ENABLE_OPERATION, State.OPERATION_ENABLED),
        (SWITCH_ON, State.SWITCHED_ON),
        (SHUTDOWN, State.READY_TO_SWITCH_ON),
        (DISABLE_VOLTAGE, State.SWITCH_ON_DISABLED),
    )


@check("F2", "6040h, 6041h", "0Fh leads from READY TO SWITCH ON to OPERATION ENABLED", Need.ENABLE)
def at_once(node: NodeUnderTest) -> None:
    _needs_drive(node)
    node.switched_off()
    _without_motion(node)
    _lead(node, (SHUTDOWN, State.READY_TO_SWITCH_ON))
    node.control(ENABLE_OPERATION)
    if not node.reached(State.OPERATION_ENABLED):
        raise DiffersError(f"it stays in {node.drive_state().name}")


@check("F3", "6040h", "a fault reset without a fault changes nothing")
def reset_alone(node: NodeUnderTest) -> None:
    _needs_drive(node)
    node.switched_off()
    node.control(Control.FAULT_RESET)
    node.wait(0.05)
    found = node.drive_state()
    expect(found is State.SWITCH_ON_DISABLED, f"the drive is in {found.name}")
    node.control(DISABLE_VOLTAGE)


@check("F4", "605Ah", "a quick stop ends in the state of its option code", Need.ENABLE)
def quick_stop(node: NodeUnderTest) -> None:
    _needs_drive(node)
    node.needed(_QUICK_STOP)
    for code, state in ((2, State.SWITCH_ON_DISABLED), (6, State.QUICK_STOP_ACTIVE)):
        node.switched_off()
        _without_motion(node)
        with node.kept(_QUICK_STOP):
            if node.write_code(_QUICK_STOP, code.to_bytes(2, "little")):
                raise DiffersError(f"605Ah does not take {code}")
            _lead(
                node,
                (SHUTDOWN, State.READY_TO_SWITCH_ON),
                (SWITCH_ON, State.SWITCHED_ON),
                (ENABLE_OPERATION, State.OPERATION_ENABLED),
            )
            node.control(ENABLE_OPERATION & ~Control.QUICK_STOP)
            expect(node.reached(state), f"with 605Ah = {code} it ends in {node.drive_state().name}, not {state.name}")
            node.control(DISABLE_VOLTAGE)


@check("F6", "6060h, 6061h, 6502h", "each supported mode is taken, another one is not")
def modes(node: NodeUnderTest) -> None:
    _needs_drive(node)
    node.switched_off()
    supported = int.from_bytes(node.needed(_SUPPORTED), "little")
    late = []
    with node.kept(MODE):
        for mode, bit in _SUPPORT_BITS.items():
            if supported >> bit & 1:
                code = node.write_code(MODE, bytes((mode,)))
                expect(not code, f"mode {mode}: {said(code)}")
                node.wait(0.05)
                if node.number(MODE_DISPLAY) != mode:
                    late.append(str(mode))
        code = node.write_code(MODE, bytes((_OTHER_MODE,)))
    right = code in (AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_HIGH, AbortCode.INCOMPATIBLE)
    if late:
        raise DiffersError(f"6061h does not follow to {', '.join(late)} while the drive is off")
    if not code:
        raise DiffersError(f"mode {_OTHER_MODE} is taken")
    expect(right, f"mode {_OTHER_MODE}: {said(code)}")


@check("F7", "605Ah to 605Eh, 6007h", "option codes refuse a value that they do not have")
def option_codes(node: NodeUnderTest) -> None:
    _needs_drive(node)
    taken, asked = [], 0
    for index, value in _OPTIONS.items():
        address = od.address_of(index)
        if not node.has(address):
            continue
        asked += 1
        with node.kept(address):
            code = node.write_code(address, value.to_bytes(2, "little"))
        if not code:
            taken.append(f"{index:04X}h")
            continue
        limits = (AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_HIGH, AbortCode.READ_ONLY)
        expect(code in limits, f"{index:04X}h = {value}: {said(code)}")
    if taken:
        raise DiffersError(f"{', '.join(taken)} take 99")
    if not asked:
        raise SkippedError("no option code")


@check("F8", "6502h", "what a supported mode needs is there")
def honest(node: NodeUnderTest) -> None:
    _needs_drive(node)
    supported = int.from_bytes(node.needed(_SUPPORTED), "little")
    needed = {1: (0x607A, 0x6081, 0x6083), 3: (0x60FF, 0x606C), 6: (0x6098, 0x609A), 7: (0x60C1,), 8: (0x607A, 0x60C2)}
    for mode, indexes in needed.items():
        if supported >> _SUPPORT_BITS[mode] & 1:
            for index in indexes:
                found = node.has(od.address_of(index)) or node.has(od.address_of(index, 1))
                expect(found, f"mode {mode} is supported, and {index:04X}h is missing")
    if supported >> _SUPPORT_BITS[7] & 1 and not node.has(od.address_of(0x60C0)):
        raise DiffersError("mode 7 is supported without 60C0h: its sub mode is linear")


@check("F9", "6091h, 6092h, 608Fh", "factors are above 0")
def factors(node: NodeUnderTest) -> None:
    _needs_drive(node)
    asked = 0
    for index in (0x608F, 0x6091, 0x6092):
        for sub in (1, 2):
            address = od.address_of(index, sub)
            if node.has(address):
                asked += 1
                expect(node.number(address) > 0, f"{od.place_text(address)} is 0")
    if not asked:
        raise SkippedError("no factor")


@check("F10", "607Ah", "a small relative move is acknowledged and reaches its target", Need.MOTION)
def small_move(node: NodeUnderTest) -> None:
    _needs_drive(node)
    if not node.number(_SUPPORTED) >> _SUPPORT_BITS[Mode.PROFILE_POSITION] & 1:
        raise SkippedError("no profile position")
    node.switched_off()
    node.download(MODE, bytes((Mode.PROFILE_POSITION,)))
    _lead(
        node,
        (SHUTDOWN, State.READY_TO_SWITCH_ON),
        (SWITCH_ON, State.SWITCHED_ON),
        (ENABLE_OPERATION, State.OPERATION_ENABLED),
    )
    before = node.number(_POSITION, signed=True)
    distance = max(node.number(od.address_of(0x608F, 1)) // 100, 1) if node.has(od.address_of(0x608F, 1)) else 1000
    node.download(_TARGET, distance.to_bytes(4, "little", signed=True))
    node.control(ENABLE_OPERATION | Control.START | Control.RELATIVE)
    until_s = node.now_s() + 1.0
    while not node.number(STATUSWORD) & _ACKNOWLEDGE:
        expect(node.now_s() < until_s, "the set-point is not acknowledged (6041h bit 12)")
        node.wait(0.005)
    node.control(ENABLE_OPERATION | Control.RELATIVE)
    until_s = node.now_s() + _MOTION_S
    while not node.number(STATUSWORD) & _REACHED:
        expect(node.now_s() < until_s, f"6041h bit 10 does not come within {_MOTION_S:g} s")
        node.wait(0.01)
    moved = node.number(_POSITION, signed=True) - before
    expect(abs(moved - distance) <= max(2, distance // 100), f"it has moved by {moved}, not by {distance}")
    node.control(DISABLE_VOLTAGE)
    expect(node.number(CONTROLWORD) == DISABLE_VOLTAGE, "6040h does not read as written")
