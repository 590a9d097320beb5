"""Report of a played scenario: strikes of each fault, comparison with the documented reaction, and its printing."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, Final

from steptwin.features.faults import NAME
from steptwin.features.faults.reaction import Reaction
from steptwin.host.cli.output import Columns, fixed, print_rows, say
from steptwin.host.client.words import state_text
from steptwin.host.common.tables import Table
from steptwin.protocol.cia402 import State


@dataclass(frozen=True, slots=True)
class ReportedError:
    """An EMCY after a fault: joint, error code, and the time from the fault's beginning until the bus had it."""

    joint: str
    code: int
    after_ms: float

    def to_dict(self) -> dict[str, Any]:
        """Return it under the keys of report.json."""
        return {"joint": self.joint, "code": f"0x{self.code:04X}", "after_ms": round(self.after_ms, 3)}


@dataclass(frozen=True, slots=True)
class JointAnswer:
    """A joint at the end of the run.

    Attributes:
        state: state of its drive.
        position_known: True if the firmware reports that it knows the position.
        lost_steps: steps since the fault's beginning that the firmware has counted and the driver has not; None if the
            board has restarted since, as its count then begins again.
    """

    state: State
    position_known: bool
    lost_steps: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return it under the keys of report.json."""
        return {
            "state": state_text(self.state),
            "position_known": self.position_known,
            "lost_steps": self.lost_steps,
        }


@dataclass(frozen=True, slots=True)
class FaultReport:
    """One fault.

    Attributes:
        name: its name in the scenario.
        request: the fault as a request of the control port.
        due: its trigger as text.
        struck_s: instant of its first strike, in seconds from the motion's start, or from power-up without one; None:
            it never struck.
        strikes: number of its strikes.
        ended_s: instant of its end; None if it lasted.
        emcys: EMCYs from its beginning to that of the next fault.
        standstill_ms: time from its beginning to the last step before standstill; None if the machine went on.
        joints: joints at the end of the run, by name.
        what: the fault in the words of the table of documented reactions; empty if it never struck.
        reaction: expected reaction; None if it never struck.
        limit_ms: longest time to standstill; None if the motion goes on.
        differences: deviations from the expected reaction, as text.
    """

    name: str
    request: Mapping[str, Any]
    due: str
    struck_s: float | None = None
    strikes: int = 0
    ended_s: float | None = None
    emcys: tuple[ReportedError, ...] = ()
    standstill_ms: float | None = None
    joints: Mapping[str, JointAnswer] = field(default_factory=dict)
    what: str = ""
    reaction: Reaction | None = None
    limit_ms: float | None = None
    differences: tuple[str, ...] = ()

    @property
    def struck(self) -> bool:
        """True if it struck."""
        return self.struck_s is not None

    @property
    def as_documented(self) -> bool:
        """True if it struck and the machine reacted as expected."""
        return self.struck and not self.differences

    def so_far(self) -> dict[str, Any]:
        """Return the fault's state before the run has ended, under the keys of report.json."""
        return {
            "name": self.name,
            "do": dict(self.request),
            "due": self.due,
            "struck_s": _rounded(self.struck_s),
            "strikes": self.strikes,
            "ended_s": _rounded(self.ended_s),
            "emcys": [each.to_dict() for each in self.emcys],
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the fault under the keys of report.json."""
        reaction = self.reaction
        return self.so_far() | {
            "standstill_ms": _rounded(self.standstill_ms),
            "joints": {name: joint.to_dict() for name, joint in self.joints.items()},
            "documented": None if reaction is None else self._documented(reaction),
            "as_documented": self.as_documented,
            "differences": list(self.differences),
        }

    def _documented(self, reaction: Reaction) -> dict[str, Any]:
        return {
            "what": self.what,
            "motion": reaction.motion.value,
            "codes": [f"0x{code:04X}" for code in reaction.codes],
            "state": None if reaction.state is None else state_text(reaction.state),
            "standstill_ms": None if self.limit_ms in (None, inf) else self.limit_ms,
            "certain": reaction.certain,
        }


@dataclass(frozen=True, slots=True)
class ScenarioReport:
    """A played scenario: its faults in order, and the reasons for its failure; none if it passed."""

    name: str
    seed: int
    faults: tuple[FaultReport, ...]
    reasons: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """True if every fault struck, had the documented reaction, and nothing was lost in silence."""
        return not self.reasons

    def to_dict(self) -> dict[str, Any]:
        """Return the scenario under the keys of report.json."""
        return {
            "scenario": {
                "name": self.name,
                "seed": self.seed,
                "passed": self.passed,
                "reasons": list(self.reasons),
            },
            "faults": [fault.to_dict() for fault in self.faults],
        }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 6)


def report_in(verdicts: Mapping[str, object]) -> ScenarioReport | None:
    """Return the report of a scenario from the verdicts of a run; None without one."""
    found = verdicts.get(NAME)
    return found if isinstance(found, ScenarioReport) else None


# --- printing: this module is the feature's `Telling`

_UNKNOWN: Final = "unknown after a reset"


def _lost(fault: Mapping[str, Any]) -> str:
    lost = {name: joint["lost_steps"] for name, joint in fault["joints"].items()}
    if lost and all(steps is None for steps in lost.values()):
        return _UNKNOWN
    texts = {name: _UNKNOWN if steps is None else fixed(steps, 0) for name, steps in lost.items() if steps != 0}
    return ", ".join(f"{name} {steps}" for name, steps in texts.items()) or "0"


_COLUMNS: Final[Columns] = {
    "fault": "{0[name]}",
    "due": "{0[due]}",
    "answer": lambda fault: " ".join(dict.fromkeys(each["code"] for each in fault["emcys"])) or "none",
    "struck s": lambda fault: "never" if fault["struck_s"] is None else f"{fault['struck_s']:.3f}",
}
_TEXTS: Final = 3
_AFTERWARDS: Final[Columns] = {
    "stood ms": lambda fault: "-" if fault["standstill_ms"] is None else f"{fault['standstill_ms']:.2f}",
    "lost steps": _lost,
    "as documented": lambda fault: "yes" if fault["as_documented"] else "NO",
}


def print_run(document: Mapping[str, Any]) -> None:
    """Print a row for each fault, and the scenario's verdict; nothing for a run without a scenario."""
    if "scenario" not in document:
        return
    scenario, faults = document["scenario"], document["faults"]
    print_rows({**_COLUMNS, **_AFTERWARDS}, faults, text_columns=_TEXTS)
    struck = sum(fault["struck_s"] is not None for fault in faults)
    verdict = "PASSED" if scenario["passed"] else "FAILED"
    say(
        f"scenario {scenario['name']}: {verdict}, {struck} of {len(faults)} faults struck, seed {scenario['seed']}",
        *(f"  {reason}" for reason in scenario["reasons"]),
    )


def print_served(document: Mapping[str, Any]) -> None:
    """Print a row for each fault of a live board, which has no plan to judge by; nothing without a scenario."""
    if "scenario" in document:
        print_rows({**_COLUMNS, "strikes": "{0[strikes]}"}, document["faults"], text_columns=_TEXTS)


def kept(report: Table) -> dict[str, Any]:
    """Return the names and first strikes of a stored report's faults; none for a run without a scenario."""
    return {"faults": list(report.each("faults", _kept_fault))} if "faults" in report else {}


def _kept_fault(table: Table) -> dict[str, Any]:
    return {"name": table.text("name"), "struck_s": None if table.is_null("struck_s") else table.number("struck_s")}


def print_verified(document: Mapping[str, Any]) -> None:
    """Print a run's faults and their strikes: a failure may have been intended."""
    for fault in document.get("faults", ()):
        struck = "never struck" if fault["struck_s"] is None else f"struck at {fault['struck_s']:.3f} s"
        say(f"fault on purpose: {fault['name']}, {struck}")


def served_failure(document: Mapping[str, Any]) -> str:
    """Return the faults of a live board's scenario that never struck; empty if all did."""
    never = [fault["name"] for fault in document.get("faults", ()) if fault["struck_s"] is None]
    return f"scenario {document['scenario']['name']}: never struck: {', '.join(never)}" if never else ""
