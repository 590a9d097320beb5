"""The table of homing methods against the figures of CiA 402-2."""

from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.homing_methods import HOMING_METHODS

NEGATIVE_LIMIT, POSITIVE_LIMIT, HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME


def test_the_methods_without_an_index_pulse() -> None:
    assert list(HOMING_METHODS) == [*range(17, 31), 35, 37]
    assert HOMING_METHODS[35] is HOMING_METHODS[37] is None


def test_switch_and_edge_of_each_method() -> None:
    edges = {number: (method.switch, method.at_lower_edge) for number, method in HOMING_METHODS.items() if method}
    assert edges == {
        17: (NEGATIVE_LIMIT, False),
        18: (POSITIVE_LIMIT, True),
        **dict.fromkeys((19, 20, 23, 24, 29, 30), (HOME, True)),
        **dict.fromkeys((21, 22, 25, 26, 27, 28), (HOME, False)),
    }


def test_the_searches_that_turn_round_and_where() -> None:
    turns = {number: method.search_direction for number, method in HOMING_METHODS.items() if method and method.turns}
    assert turns == {**dict.fromkeys(range(23, 27), 1), **dict.fromkeys(range(27, 31), -1)}
