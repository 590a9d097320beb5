"""Play a scenario on an emulated machine: its engine, the host's condition, and the verdict on the run."""

from collections.abc import Mapping
from typing import Any

from steptwin.features.faults import NAME
from steptwin.features.faults.engine import Engine
from steptwin.features.faults.judge import played_document, scenario_report
from steptwin.features.faults.kinds.host import NO_HOST, HostCondition
from steptwin.features.faults.lost_host import FaultyNetwork, replace_host, without_host
from steptwin.features.faults.report import ScenarioReport
from steptwin.features.faults.scenario import Scenario
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.common.features import MachinePart
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.outcome import RunEnd, RunFault
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine


class FaultsPart(MachinePart):
    """A scenario on one machine.

    Attributes:
        scenario: the faults.
        host: condition of the host.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.host: HostCondition = HostCondition()
        self._engine: Engine | None = None

    @property
    def engine(self) -> Engine:
        """Engine of the scenario, once the machine is switched on."""
        assert self._engine is not None, "the machine is not switched on"
        return self._engine

    def switched_on(self, machine: EmulatedMachine) -> None:
        """Begin faults that are due at power-up.

        Raises:
            InputError: the machine lacks the target of a fault.
        """
        self._engine = Engine(self.scenario, machine, self.host)

    def check_live(self) -> None:
        if self.scenario.of_host:
            raise InputError(f"{self.scenario.name}: {NO_HOST}")

    def network(self) -> FaultyNetwork | None:
        if not self.scenario.of_host:
            return None
        target = self.engine.target
        return FaultyNetwork(target.simulation, self.host, lambda: target.interpolating)

    def outlive(self, board: EmbeddedBoard, error: BusError) -> RunFault:
        return without_host(error, board, self.engine, self.host)

    def document(self) -> Mapping[str, Any]:
        return played_document(self.engine)

    def in_words(self) -> str:
        """Return the state of each fault so far, a line each."""
        lines = []
        for fault in self.document()[NAME]:
            struck = "never struck" if fault["struck_s"] is None else f"struck at {fault['struck_s']:.6f} s"
            codes = " ".join(dict.fromkeys(each["code"] for each in fault["emcys"])) or "no EMCY"
            lines.append(f"{fault['name']}: {fault['due']}: {struck}, {fault['strikes']} times, {codes}")
        return "\n".join(lines)

    def verdict(self, end: RunEnd) -> ScenarioReport | None:
        """Judge the reactions, which are documented for StepTwin's firmware; None for another one."""
        if not all(board.runs_own for board in self.engine.target.simulation.boards):
            return None
        return scenario_report(self.engine, end)


def part_of(board: EmbeddedBoard) -> FaultsPart | None:
    """Return the scenario of a board; None without one."""
    part = board.parts.get(NAME)
    return part if isinstance(part, FaultsPart) else None


def repair(board: EmbeddedBoard) -> None:
    """End every lasting fault of the scenario and prevent further ones; replace a dead host."""
    part = part_of(board)
    if part is not None:
        part.engine.repair()
        replace_host(board, part.host)
