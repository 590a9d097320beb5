"""The CiA 402 state machine against two independent statements: the standard's table and the canopen library's."""

import pytest
from canopen.profiles.p402 import State402

from steptwin.controller.node.power_states import next_state
from steptwin.protocol.cia402 import State
from tests.messages import refusing

RTSO, SO, OE = State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.OPERATION_ENABLED
SOD, QSA = State.SWITCH_ON_DISABLED, State.QUICK_STOP_ACTIVE

BY_CONTROLWORD: dict[State, dict[int, State]] = {
    State.NOT_READY_TO_SWITCH_ON: {},
    SOD: {0x06: RTSO},
    RTSO: {0x07: SO, 0x0F: OE, 0x00: SOD, 0x02: SOD, 0x80: SOD},
    SO: {0x06: RTSO, 0x0F: OE, 0x00: SOD, 0x02: SOD, 0x80: SOD},
    OE: {0x06: RTSO, 0x07: SO, 0x00: SOD, 0x02: QSA, 0x80: SOD},
    QSA: {0x0F: OE, 0x00: SOD, 0x80: SOD},
    State.FAULT_REACTION_ACTIVE: {},
    State.FAULT: {0x80: SOD},
}
"""The state to which each of the standard's controlwords leads from each state; others change nothing."""


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("controlword", [0x06, 0x07, 0x0F, 0x00, 0x02, 0x80])
def test_the_standards_table(state: State, controlword: int) -> None:
    assert next_state(state, controlword, 0) is BY_CONTROLWORD[state].get(controlword, state)


@pytest.mark.parametrize("state", list(State))
def test_only_bits_0_to_3_and_7_count(state: State) -> None:
    """A controlword has the effect of its command bits alone, after any previous word: each other bit, and all."""
    for previous in (0x00, 0x80):
        for command_bits in (*range(16), *range(0x80, 0x90)):
            expected = next_state(state, command_bits, previous)
            for other_bits in (*(1 << bit for bit in (4, 5, 6, *range(8, 16))), 0xFF70):
                assert next_state(state, other_bits | command_bits, previous) is expected


def test_fault_is_left_by_a_rising_edge_only() -> None:
    assert next_state(State.FAULT, 0x80, previous=0x80) is State.FAULT
    assert next_state(State.FAULT, 0x8F, previous=0x0F) is SOD
    assert all(next_state(State.FAULT, word, previous=0) is State.FAULT for word in range(0x80))


def test_the_canopen_library_agrees_on_every_transition_it_knows() -> None:
    """Each controlword of the library's master moves our drive between the states that the library expects."""
    automatic = {"START", "NOT READY TO SWITCH ON", "FAULT REACTION ACTIVE"}
    checked = 0
    for (before, after), controlword in State402.TRANSITIONTABLE.items():
        if before in automatic or after == "FAULT":
            continue
        state, target = State[before.replace(" ", "_")], State[after.replace(" ", "_")]
        assert next_state(state, controlword, 0) is target, (before, after)
        checked += 1
    assert checked >= 12


def test_every_state_is_read_back_from_its_statusword() -> None:
    for state in State:
        for other_bits in (0x0000, 0xFF90):
            assert State.of(state.bits | other_bits & ~0x6F) is state
    with refusing(ValueError):
        State.of(0x0001)
