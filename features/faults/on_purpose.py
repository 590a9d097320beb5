"""Faults on purpose: print what has become of them."""

from collections.abc import Mapping
from typing import Any, Final

from steptwin.host.cli.output import Columns, fixed, print_rows, say
from steptwin.host.common.tables import Table

_UNKNOWN: Final = "unknown after a reset"


def _lost(fault: Mapping[str, Any]) -> str:
    lost = {name: joint["lost_steps"] for name, joint in fault["joints"].items()}
    if lost and all(steps is None for steps in lost.values()):
        return _UNKNOWN
    told = {name: _UNKNOWN if steps is None else fixed(steps, 0) for name, steps in lost.items() if steps != 0}
    return ", ".join(f"{name} {steps}" for name, steps in told.items()) or "0"


_COLUMNS: Final[Columns] = {
    "fault": "{0[name]}",
    "due": "{0[due]}",
    "answer": lambda fault: " ".join(dict.fromkeys(told["code"] for told in fault["emcys"])) or "none",
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
    """Print a row for each fault of a live board, on which no plan says what is right; nothing without a scenario."""
    if "scenario" in document:
        print_rows({**_COLUMNS, "strikes": "{0[strikes]}"}, document["faults"], text_columns=_TEXTS)


def kept(report: Table) -> dict[str, Any]:
    """Return the faults of a stored report with their names and first strikes; none for a run without a scenario."""
    return {"faults": list(report.each("faults", _kept_fault))} if "faults" in report else {}


def _kept_fault(table: Table) -> dict[str, Any]:
    return {"name": table.text("name"), "struck_s": None if table.is_null("struck_s") else table.number("struck_s")}


def print_verified(document: Mapping[str, Any]) -> None:
    """Print which faults a run had, and when they struck: what is wrong with it may have been meant."""
    for fault in document.get("faults", ()):
        struck = "never struck" if fault["struck_s"] is None else f"struck at {fault['struck_s']:.3f} s"
        say(f"fault on purpose: {fault['name']}, {struck}")


def served_failure(document: Mapping[str, Any]) -> str:
    """Return which faults of a live board's scenario never struck; empty if all did."""
    never = [fault["name"] for fault in document.get("faults", ()) if fault["struck_s"] is None]
    return f"scenario {document['scenario']['name']}: never struck: {', '.join(never)}" if never else ""
