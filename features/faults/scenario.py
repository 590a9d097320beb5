"""A scenario: the faults of a run, as data, and its TOML file (docs/faults.md).

The same scenario on the same run gives the same bytes. Every error of reading begins with the place, as in
`fault 2: at_s: is missing`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from reprlib import repr as short
from typing import Annotated, Any, Final

from pydantic import TypeAdapter
from pydantic_core import CoreSchema, core_schema

from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds import FAULTS
from steptwin.features.faults.kinds.host import HostFault
from steptwin.features.faults.reaction import MotionEffect, Reaction
from steptwin.features.faults.requests import by_name, fault_of, model_of, read_as, read_fault_table, whole_number
from steptwin.features.faults.triggers import AtTime, DriveState, Time, Trigger, TriggerKeys
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import KIB, NAME_CHARS_MAX
from steptwin.host.common.file_models import FileTable, read_model
from steptwin.host.common.file_values import Name, NotNegative
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import toml_table
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import ErrorCode

SCENARIO_BYTES_MAX: Final = 256 * KIB
"""A fault of a scenario has some 100 bytes; a thousand of them fit."""


@dataclass(frozen=True, slots=True)
class TriggeredFault:
    """A fault with its trigger and its end.

    Attributes:
        name: its name in reports; unique in its scenario.
        trigger: trigger of its beginning.
        fault: the fault.
        until: trigger of its end; a number is seconds from its beginning; None: it lasts until the run's end.
        expected: expected reaction if it is not the documented one (`Fault.documented`).
    """

    name: str
    trigger: Trigger
    fault: Fault
    until: Trigger | float | None = None
    expected: Reaction | None = None


@dataclass(frozen=True, slots=True)
class Scenario:
    """Faults, and the seed of all random values.

    Raises:
        ValueError: two faults have the same name.
    """

    name: str
    faults: tuple[TriggeredFault, ...]
    seed: int = 0

    def __post_init__(self) -> None:
        names = [fault.name for fault in self.faults]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two faults are called {twice[0]!r}")

    @classmethod
    def from_power_up(cls, faults: Iterable[Fault]) -> "Scenario":
        """Return the scenario of faults that begin at power-up; their names are numbers and requests."""
        begin = AtTime(0.0, from_power_up=True)
        return cls(
            "faults", tuple(TriggeredFault(f"{number} {each.do}", begin, each) for number, each in enumerate(faults, 1))
        )

    @property
    def of_host(self) -> bool:
        """True if a fault concerns the host; a board in real time has none."""
        return any(isinstance(each.fault, HostFault) for each in self.faults)

    def drawn(self) -> "Scenario":
        """Return the scenario with random times drawn, each independently of the other faults.

        So a fault keeps its instant when others are removed.
        """
        return replace(self, faults=tuple(self._drawn(each) for each in self.faults))

    def _drawn(self, each: TriggeredFault) -> TriggeredFault:
        random = Random(f"{self.seed} {each.name}")
        trigger, until = each.trigger.drawn(random), each.until
        return replace(each, trigger=trigger, until=until.drawn(random) if isinstance(until, Trigger) else until)


# --- its file


def _codes(values: object) -> tuple[ErrorCode, ...]:
    if not isinstance(values, list):
        raise InputError(f"{short(values)} is not a list")
    for value in values:
        if not isinstance(value, int) or value not in set(ErrorCode):
            raise InputError(f"{value!r} is none of the board's error codes, such as 0x{ErrorCode.ESTOP:04X}")
    return tuple(map(ErrorCode, values))


SEED_MAX: Final = (1 << 31) - 1


@dataclass(frozen=True, slots=True)
class ExpectedKeys(FileTable):
    """An expected reaction other than the documented one."""

    motion: Annotated[MotionEffect, by_name({each.name.lower().replace("_", "-"): each for each in MotionEffect})]
    codes: Annotated[tuple[ErrorCode, ...], read_as(_codes, {"type": "array", "items": {"type": "integer"}})] = ()
    state: DriveState | None = None
    within_ms: NotNegative = 0.0
    certain: bool = True

    def reaction(self) -> Reaction:
        """Return the reaction; raise InputError for a state after a motion that goes on."""
        try:
            return Reaction(self.motion, self.codes, self.state, self.within_ms, self.certain)
        except ValueError as error:
            raise InputError(f"expect.{error}") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultKeys(TriggerKeys):
    """What every [[fault]] may have beside `do` and the keys of what it does.

    Attributes:
        name: what reports call it.
        for_s: duration.
        until: trigger that ends it.
        expect: the reaction that is right in place of the documented one.
    """

    name: Annotated[str, Name(NAME_CHARS_MAX)] | None = None
    for_s: Time | None = None
    until: TriggerKeys | None = None
    expect: ExpectedKeys | None = None


class _AnyFault:
    """Annotates a list of faults, each of which is read for a robot by the model of its `do`."""

    def __get_pydantic_core_schema__(self, _source: object, _handler: object) -> CoreSchema:
        return core_schema.list_schema()

    def __get_pydantic_json_schema__(self, _schema: CoreSchema, _handler: object) -> dict[str, Any]:
        return {
            "type": "array",
            "minItems": 1,
            "items": {"oneOf": [TypeAdapter(model_of(do, FaultKeys)).json_schema() for do in FAULTS]},
        }


@dataclass(frozen=True, slots=True)
class ScenarioFile(FileTable):
    """A scenario: faults on purpose.

    Attributes:
        fault: the faults.
        name: what reports call it.
        title: a line for people.
        seed: seed of everything that is random.
    """

    fault: Annotated[list[Any], _AnyFault()] = field(default_factory=list)
    name: Annotated[str, Name(NAME_CHARS_MAX)] = "scenario"
    title: str = ""
    seed: Annotated[int, whole_number(0, SEED_MAX)] = 0


def read_scenario(path: Path | str, robot: Robot) -> Scenario:
    """Read a scenario for a robot; raise InputError, with file and place, for errors."""
    findings = Findings()
    with prefixed(f"{path}: "):
        scenario = parse_scenario(read_text(path, SCENARIO_BYTES_MAX), robot, findings)
        findings.raise_first()
    return scenario


def parse_scenario(text: str, robot: Robot, findings: Findings) -> Scenario:
    """Return the scenario of a TOML text without its invalid parts; their errors are added to the findings.

    Raises InputError only for a text that is not TOML.
    """
    return scenario_of(toml_table(text).values, robot, findings)


def scenario_of(values: Mapping[str, Any], robot: Robot, findings: Findings) -> Scenario:
    """Return the scenario of a table with the keys `name`, `seed` and `fault`; errors are added to the findings."""
    file, faults = read_model(ScenarioFile, values, findings), list[TriggeredFault]()
    with findings.collecting():
        if not file.fault:
            raise InputError("fault: is missing: a scenario has at least one [[fault]]")
        for number, each in enumerate(file.fault, 1):
            with findings.collecting(f"fault {number}: "):
                found = len(findings.messages)
                fault = _fault(each, robot, number, findings.under(f"fault {number}: "))
                if fault.name in [other.name for other in faults]:
                    raise InputError(f"name: {fault.name!r} is the name of another fault")
                if len(findings.messages) == found:
                    faults.append(fault)
        return Scenario(file.name, tuple(faults), file.seed)
    return Scenario("scenario", tuple(faults))


def _fault(values: object, robot: Robot, number: int, findings: Findings) -> TriggeredFault:
    keys = read_fault_table(values, findings, FaultKeys)
    fault, trigger, until = fault_of(robot, keys), keys.trigger(robot), keys.for_s
    if fault is None:
        raise InputError("do: 'state' is no fault: it changes nothing")
    if keys.until is not None:
        if until is not None:
            raise InputError("for_s: a fault has for_s or until, not both")
        with prefixed("until."):
            until = keys.until.trigger(robot)
    if until is not None and (why := fault.why_endless()):
        raise InputError(f"{'for_s' if keys.until is None else 'until'}: this fault has no end: {why}")
    expected = None if keys.expect is None else keys.expect.reaction()
    return TriggeredFault(keys.name or f"{number} {keys.do}", trigger, fault, until, expected)
