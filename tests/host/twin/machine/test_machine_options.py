"""The options of an emulated machine, as one object and as keyword arguments."""

from dataclasses import fields
from typing import get_type_hints

from steptwin.host.twin.machine.machine_options import MachineKeywords, MachineOptions


def test_every_option_is_a_keyword_of_the_functions_that_users_call() -> None:
    """Type checkers see the keywords alone; each has the type of its option."""
    options = get_type_hints(MachineOptions)
    assert get_type_hints(MachineKeywords) == {field.name: options[field.name] for field in fields(MachineOptions)}


def test_a_crystal_is_that_of_each_board() -> None:
    assert MachineOptions().crystals_ppm == (0,)
    assert MachineOptions(axes_per_board=(2, 2), crystal_ppm=-7).crystals_ppm == (-7, -7)
    assert MachineOptions(axes_per_board=(2, 2), crystal_ppm=[3, 4]).crystals_ppm == (3, 4)
