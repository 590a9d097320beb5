"""A scenario: the faults that happen in a run, as data, and how it is read from TOML (docs/faults.md).

The same scenario on the same run gives the same bytes. Every error of reading begins with the place, as in
`fault 2: at_s: is missing`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, Final

from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds.host import HostFault
from steptwin.features.faults.reaction import Motion, Reaction
from steptwin.features.faults.requests import read_fault
from steptwin.features.faults.triggers import TRIGGERS, AtTime, Trigger, read_state, read_time_s
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX, SCENARIO_BYTES_MAX
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import Table, integer_from, number_from, toml_table
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import ErrorCode


@dataclass(frozen=True, slots=True)
class TriggeredFault:
    """A fault and what starts and ends it.

    Attributes:
        name: what reports call it; unique in its scenario.
        trigger: what starts it.
        fault: what goes wrong.
        until: what ends it; a number is seconds from its start; None: it lasts until the run's end.
        expected: the reaction that is right, where the documented one is not (`Fault.documented`).
    """

    name: str
    trigger: Trigger
    fault: Fault
    until: Trigger | float | None = None
    expected: Reaction | None = None


@dataclass(frozen=True, slots=True)
class Scenario:
    """Faults, and the seed of everything in them that is random.

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
        """Return the scenario of faults that begin at power-up; each is called by its number and what it does."""
        begin = AtTime(0.0, from_power_up=True)
        return cls(
            "faults", tuple(TriggeredFault(f"{number} {each.do}", begin, each) for number, each in enumerate(faults, 1))
        )

    @property
    def of_host(self) -> bool:
        """True if a fault concerns the host, which a board in real time does not have."""
        return any(isinstance(each.fault, HostFault) for each in self.faults)

    def drawn(self) -> "Scenario":
        """Return the scenario with a time in place of each random one: a fault's own, whatever other faults there are.

        So a fault keeps its instant when others are taken out.
        """
        return replace(self, faults=tuple(self._drawn(each) for each in self.faults))

    def _drawn(self, each: TriggeredFault) -> TriggeredFault:
        random = Random(f"{self.seed} {each.name}")
        trigger, until = each.trigger.drawn(random), each.until
        return replace(each, trigger=trigger, until=until.drawn(random) if isinstance(until, Trigger) else until)


SEED_MAX: Final = (1 << 31) - 1


def read_scenario(path: Path | str, robot: Robot) -> Scenario:
    """Return the scenario in a file for a robot; raise InputError, with file and place, for what is wrong in it."""
    findings = Findings()
    with prefixed(f"{path}: "):
        scenario = parse_scenario(read_text(path, SCENARIO_BYTES_MAX), robot, findings)
        findings.raise_first()
    return scenario


def parse_scenario(text: str, robot: Robot, findings: Findings) -> Scenario:
    """Return the scenario of a TOML text, without the parts that are wrong: these are added to the findings.

    Raises InputError only for a text that is not TOML.
    """
    return scenario_of(toml_table(text), robot, findings)


def scenario_of(table: Table, robot: Robot, findings: Findings) -> Scenario:
    """Return the scenario of a table with the keys `name`, `seed` and `fault`; wrong parts become findings."""
    values: dict[str, Any] = {}
    with findings.collecting():
        values = table.read({}, {"name": _name, "seed": _seed, "fault": Table.elements, "title": Table.text})
    faults: list[TriggeredFault] = []
    for number, element in enumerate(values.get("fault") or [], 1):
        with findings.collecting(f"fault {number}: "):
            fault = _fault(Table(element, "table"), robot, number)
            if fault.name in [other.name for other in faults]:
                raise InputError(f"name: {fault.name!r} is the name of another fault")
            faults.append(fault)
    if not values.get("fault") and not findings.messages:
        findings.add("fault: is missing: a scenario has at least one [[fault]]")
    return Scenario(values.get("name") or "scenario", tuple(faults), values.get("seed") or 0)


def _name(table: Table, key: str) -> str:
    return table.name(key, NAME_CHARS_MAX)


_seed: Final = integer_from(0, SEED_MAX)


# --- faults


def _fault(table: Table, robot: Robot, number: int) -> TriggeredFault:
    fault, values = read_fault(
        robot,
        table,
        {
            "name": _name,
            **{key: partial(read, robot) for key, read in TRIGGERS.items()},
            "for_s": read_time_s,
            "until": partial(_until, robot),
            "expect": _expect,
        },
    )
    if fault is None:
        raise InputError("do: 'state' is no fault: it changes nothing")
    trigger, until = _one_trigger(values), _end(fault, values)
    return TriggeredFault(values["name"] or f"{number} {table.text('do')}", trigger, fault, until, values["expect"])


def _one_trigger(values: Mapping[str, Any]) -> Trigger:
    given = [key for key in TRIGGERS if values[key] is not None]
    if len(given) != 1:
        raise InputError(f"a fault has exactly one of {', '.join(TRIGGERS)}, not {' and '.join(given) or 'none'}")
    trigger: Trigger = values[given[0]]
    return trigger


def _end(fault: Fault, values: Mapping[str, Any]) -> Trigger | float | None:
    given = [key for key in ("for_s", "until") if values[key] is not None]
    if len(given) > 1:
        raise InputError("for_s: a fault has for_s or until, not both")
    if given and (why := fault.why_endless()):
        raise InputError(f"{given[0]}: this fault has no end: {why}")
    until: Trigger | float | None = values[given[0]] if given else None
    return until


def _until(robot: Robot, table: Table, key: str) -> Trigger:
    with table.section(key) as section:
        section.check_keys(TRIGGERS)
        return _one_trigger(
            {each: read(robot, section, each) if each in section else None for each, read in TRIGGERS.items()}
        )


# --- an expected reaction other than the documented one


def _expect(table: Table, key: str) -> Reaction:
    with table.section(key) as section:
        values = section.read(
            {"motion": _motion},
            {"codes": Table.elements, "state": read_state, "within_ms": number_from(0), "certain": Table.truth},
        )
        codes = tuple(_code(code) for code in values["codes"] or ())
        try:
            return Reaction(
                motion=values["motion"],
                codes=codes,
                state=values["state"],
                begins_ms=values["within_ms"] or 0.0,
                certain=values["certain"] is not False,
            )
        except ValueError as error:
            raise InputError(str(error)) from error


def _motion(table: Table, key: str) -> Motion:
    name = table.text(key)
    motions = {motion.name.lower().replace("_", "-"): motion for motion in Motion}
    if name not in motions:
        raise unknown(key, name, motions)
    return motions[name]


def _code(value: object) -> ErrorCode:
    if not isinstance(value, int) or value not in set(ErrorCode):
        raise InputError(f"codes: {value!r} is none of the board's error codes, such as 0x{ErrorCode.ESTOP:04X}")
    return ErrorCode(value)
