"""The scenario of an emulated machine: in a file, as an object, or faults from power-up on."""

from steptwin.features.faults.kinds.bus import FrameLoss
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.scenario import Scenario, TriggeredFault
from steptwin.features.faults.triggers import AtTime
from steptwin.host.robots import load_robot


def test_faults_stand_for_a_scenario_from_power_up_on() -> None:
    stop, loss, begin = EmergencyStop(pressed=True), FrameLoss(count=1), AtTime(0.0, from_power_up=True)
    scenario = Scenario("faults", (TriggeredFault("1 estop", begin, stop), TriggeredFault("2 loss", begin, loss)))
    robot = load_robot("lab-scara")
    assert FaultOptions(scenario=[stop, loss]).scenario_for(robot) == scenario
    assert FaultOptions(scenario=scenario).scenario_for(robot) is scenario
    assert FaultOptions().scenario_for(robot) is None
