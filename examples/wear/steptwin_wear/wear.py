"""The section of robot files, the participant that counts turns, what is told of them, and `steptwin wear DIR`."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from steptwin.emulator.simulation import Simulation
from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RunDir
from steptwin.host.cli.output import print_table
from steptwin.host.common.features import MachinePart
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Positive
from steptwin.host.common.tables import Table
from steptwin.host.verify.figures import FigureLimit, ReportFigure, SeenAxis

EVERY_COUNTS, UNITS_PER_TURN = 72_000_000 // 100, 200 * 16_384  # a look each 10 ms; full steps in wire units


@dataclass(frozen=True)
class WearSection(FileTable):
    """The wear of the motors.

    Attributes:
        life_turns: turns of its motor that an axis lasts.
    """

    life_turns: Positive

    def check(self, robot: Any) -> None:
        pass  # it names nothing of the robot


@dataclass
class WearPart(MachinePart):
    """Adds up the turns of all motors of a machine: part and participant in one."""

    robot: Any
    next_due_counts: int | None = EVERY_COUNTS
    units: Sequence[int] = ()  # at the last look
    turned_units: Sequence[int] = ()  # added up

    def join(self, simulation: Simulation) -> "WearPart":
        self.simulation = simulation
        self.units = self.turned_units = [0] * len(self.robot.axes)
        return self

    def step(self, now_counts: int) -> None:
        if self.next_due_counts is not None and now_counts >= self.next_due_counts:
            self.next_due_counts = now_counts + EVERY_COUNTS
            boards = self.simulation.boards
            now = [board.shaft(i).position_units for board in boards for i in range(board.config.axis_count)]
            ways = zip(self.turned_units, now, self.units, strict=True)
            self.turned_units, self.units = [way + abs(new - old) for way, new, old in ways], now

    def evidence(self) -> dict[str, Any]:
        turns = {name: way / UNITS_PER_TURN for name, way in zip(self.robot.axis_names, self.turned_units, strict=True)}
        return {"life_turns": self.robot.sections["wear"].life_turns, "turns": turns}

    seen = evidence


def reasons(evidence: dict[str, Any], expected: None, start_counts: int) -> list[str]:
    worn = (axis for axis, turns in evidence["turns"].items() if turns > evidence["life_turns"])
    return [f"wear: {axis} has turned more often than it lasts" for axis in worn]


def document(evidence: dict[str, Any], start_counts: int) -> dict[str, Any]:
    return {}  # its figures are all that a report has


def turns(axis: SeenAxis) -> float:
    return float(axis.seen["turns"][axis.name])


LIFE = FigureLimit("wear", "turns, of those that a motor lasts", lambda robot, _: robot.sections["wear"].life_turns)
FIGURES = {  # of each axis: for report.json, a column of the verdict and, with a limit, for campaigns
    "turns": ReportFigure(says="turns of the motor", of=turns, heading="turns", form="{:.3f}", limit=LIFE),
    "life_percent": ReportFigure(says="life used", of=lambda axis: 100.0 / axis.seen["life_turns"] * turns(axis)),
}


def contradictions(evidence: dict[str, Any], comparison: Any) -> Iterable[str]:
    return ()  # the drivers' counts tell where an axis ends, not how far it went


def stored(evidence: dict[str, Any], expected: None, start_counts: int) -> dict[str, Any]:
    return evidence


def read(table: Table) -> tuple[dict[str, Any], None]:
    with table.section("turns") as turns:
        return {"life_turns": table.number("life_turns"), "turns": {axis: turns.number(axis) for axis in turns}}, None


@command("out/spiral", "out/carry")
def wear(folder: RunDir) -> None:
    """Tell how worn a run leaves the axes."""
    axes = json.loads((folder / "report.json").read_text())["wear"]["axes"].items()
    rows = [[axis, f"{each['turns']:.3f}", f"{each['life_percent']:.2g}"] for axis, each in axes]
    print_table(["axis", "turns", "% of its life"], rows, text_columns=1)
