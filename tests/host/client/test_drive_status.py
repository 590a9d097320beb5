"""Decoding of TPDO1."""

import pytest

from steptwin.host.client.drive_status import DriveStatus
from steptwin.protocol.cia402 import Mode, State, Status
from tests.messages import refusing

ENABLED = State.OPERATION_ENABLED.bits | Status.VOLTAGE_ENABLED


def status(word: int, mode: int = Mode.INTERPOLATED_POSITION) -> DriveStatus:
    return DriveStatus.decode(word.to_bytes(2, "little") + bytes((mode,)) + (-5).to_bytes(4, "little", signed=True))


def test_golden() -> None:
    assert DriveStatus.decode(bytes.fromhex("3716 07 fbffffff")) == (0x1637, State.OPERATION_ENABLED, 7, -5)


@pytest.mark.parametrize("data", ["", "371607fbffff", "371607fbffffff00", "010007fbffffff"])
def test_malformed_data_are_refused(data: str) -> None:
    with refusing(ValueError):
        DriveStatus.decode(bytes.fromhex(data))


@pytest.mark.parametrize(
    ("word", "mode", "interpolating", "halted"),
    [
        (ENABLED | Status.IP_ACTIVE, Mode.INTERPOLATED_POSITION, True, False),
        (ENABLED | Status.IP_ACTIVE | Status.TARGET_REACHED, Mode.INTERPOLATED_POSITION, True, True),
        (ENABLED | Status.TARGET_REACHED, Mode.INTERPOLATED_POSITION, False, False),
        (ENABLED | Status.HOMING_ATTAINED | Status.TARGET_REACHED, Mode.HOMING, False, False),
        (State.SWITCHED_ON.bits | Status.IP_ACTIVE | Status.TARGET_REACHED, 7, False, False),
        (State.FAULT.bits | Status.IP_ACTIVE | Status.TARGET_REACHED, 7, False, False),
    ],
)
def test_interpolating_and_halted(word: int, mode: int, interpolating: bool, halted: bool) -> None:
    assert (status(word, mode).interpolating, status(word, mode).halted) == (interpolating, halted)


def test_in_fault() -> None:
    faulty = {state for state in State if status(state.bits).in_fault}
    assert faulty == {State.FAULT, State.FAULT_REACTION_ACTIVE}
