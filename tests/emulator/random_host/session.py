"""A session of a random host as data: the machine, then every action with its instant; one JSON line each in a file."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from steptwin.emulator.board.board import BoardConfig
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.operations import Operation
from steptwin.emulator.world.switches import Switch
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.drivers import bare_chip
from steptwin.protocol.frame import Frame
from tests.operations import BoardTemperature, DriverProtect, EmergencyStop, StuckSwitch, Supply


@dataclass(frozen=True, slots=True)
class PowerCycle:
    """The board's supply is switched off and on again."""


@dataclass(frozen=True, slots=True)
class BusOff:
    """The board's CAN controller goes bus-off, as after too many errors."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Nothing is done; the last action, so that the session's end has an instant."""


Action = Frame | Operation | PowerCycle | BusOff | Pause
_OPERATIONS = (EmergencyStop, DriverProtect, Supply, BoardTemperature, StuckSwitch)
_KINDS = {kind.__name__: kind for kind in (*_OPERATIONS, PowerCycle, BusOff, Pause)}


class Step(NamedTuple):
    """An action and its instant in counts; a frame is given to the host's CAN controller then."""

    at_counts: int
    action: Action


@dataclass(frozen=True, slots=True)
class Setup:
    """The machine of a session."""

    bitrate: int
    board: BoardConfig
    steady_ramps: bool = False
    """True if the host leaves speed limit and ramps as it has set them first, so that they can be checked."""


@dataclass(frozen=True, slots=True)
class Session:
    """A session that can be repeated."""

    setup: Setup
    steps: tuple[Step, ...]

    def save(self, path: Path) -> None:
        """Write the session to a file."""
        lines = [_setup_record(self.setup), *(_step_record(step) for step in self.steps)]
        path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="ascii")

    @classmethod
    def load(cls, path: Path) -> "Session":
        """Read a session from a file."""
        first, *others = path.read_text(encoding="ascii").splitlines()
        return cls(_setup(json.loads(first)), tuple(_step(json.loads(line)) for line in others))

    def only(self, steps: Iterable[Step]) -> "Session":
        """Return the session with some of its steps, and its end where it was."""
        return Session(self.setup, (*steps, self.steps[-1]))


def _setup_record(setup: Setup) -> dict[str, Any]:
    board = setup.board
    return {
        "axes": board.axis_count,
        "bitrate": setup.bitrate,
        "read_latency_counts": board.read_latency_counts,
        "start_substeps": board.start_substeps,
        "switches": [asdict(switch) | {"input": switch.input.name} for switch in board.switches],
        "steady_ramps": setup.steady_ramps,
    }


def _setup(record: dict[str, Any]) -> Setup:
    switches = (Switch(**switch | {"input": DigitalInput[switch["input"]]}) for switch in record["switches"])
    start_substeps = tuple(record["start_substeps"])
    board = machine_board(record["read_latency_counts"], tuple(switches), start_substeps)
    return Setup(record["bitrate"], board, record["steady_ramps"])


def machine_board(
    read_latency_counts: int, switches: tuple[Switch, ...], start_substeps: tuple[int, ...]
) -> BoardConfig:
    """Return a board with an axis for each start position; its bare chips see the pins as the firmware sets them."""
    return BoardConfig(
        modules=(fitted(bare_chip(330), 16),) * len(start_substeps),
        read_latency_counts=read_latency_counts,
        switches=switches,
        start_substeps=start_substeps,
    )


def _step_record(step: Step) -> dict[str, Any]:
    action = step.action
    if isinstance(action, Frame):
        return {"at_counts": step.at_counts, "frame": f"{action.cob_id:03X}#{action.data.hex()}"}
    return {"at_counts": step.at_counts, type(action).__name__: asdict(action)}


def _step(record: dict[str, Any]) -> Step:
    at_counts = record.pop("at_counts")
    ((kind, content),) = record.items()
    if kind == "frame":
        cob_id, data = content.split("#")
        return Step(at_counts, Frame(int(cob_id, 16), bytes.fromhex(data)))
    return Step(at_counts, _KINDS[kind](**content))
