"""The options of an emulated machine, as one object and as keyword arguments."""

from dataclasses import fields
from typing import get_type_hints

from steptwin.features.faults.kinds.bus import FrameLoss
from steptwin.features.faults.kinds.harm import Harm
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.faults.scenario import Fault, Scenario
from steptwin.features.faults.triggers import AtTime
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.machine_options import MachineKeywords, MachineOptions


def test_every_option_is_a_keyword_of_the_functions_that_users_call() -> None:
    """Type checkers see the keywords alone; each has the type of its option."""
    named = {"Scenario": Scenario, "Harm": Harm}
    options = get_type_hints(MachineOptions, localns=named)
    assert get_type_hints(MachineKeywords, localns=named) == {
        field.name: options[field.name] for field in fields(MachineOptions)
    }


def test_harms_stand_for_a_scenario_from_power_up_on() -> None:
    stop, loss, begin = EmergencyStop(pressed=True), FrameLoss(count=1), AtTime(0.0, from_power_up=True)
    scenario = Scenario("harms", (Fault("1 estop", begin, stop), Fault("2 loss", begin, loss)))
    robot = load_robot("lab-scara")
    assert MachineOptions(scenario=[stop, loss]).scenario_for(robot) == scenario
    assert MachineOptions(scenario=scenario).scenario_for(robot) is scenario
    assert MachineOptions().scenario_for(robot) is None


def test_a_crystal_is_that_of_each_board() -> None:
    assert MachineOptions().crystals_ppm == (0,)
    assert MachineOptions(axes_per_board=(2, 2), crystal_ppm=-7).crystals_ppm == (-7, -7)
    assert MachineOptions(axes_per_board=(2, 2), crystal_ppm=[3, 4]).crystals_ppm == (3, 4)
