"""Faults on purpose: print what has become of them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import typer

from steptwin.host.cli.output import fixed, print_table, say, tell
from steptwin.host.cli.run.verdict_text import EXIT_NOT_VERIFIED


def print_faults(document: Mapping[str, Any]) -> None:
    """Print a row for each fault, and the scenario's verdict; nothing for a run without a scenario."""
    if "scenario" not in document:
        return
    rows = [
        [
            *_beginning(fault),
            "-" if fault["standstill_ms"] is None else f"{fault['standstill_ms']:.2f}",
            _lost(fault),
            "yes" if fault["as_documented"] else "NO",
        ]
        for fault in document["faults"]
    ]
    print_table([*_COLUMNS, "stood ms", "lost steps", "as documented"], rows, text_columns=_TEXTS)
    scenario = document["scenario"]
    verdict = "PASSED" if scenario["passed"] else "FAILED"
    say(
        f"scenario {scenario['name']}: {verdict}, {_struck(document)} of {len(rows)} faults struck,"
        f" seed {scenario['seed']}",
        *(f"  {reason}" for reason in scenario["reasons"]),
    )


@contextmanager
def telling_of_faults(*, as_json: bool) -> Iterator[None]:
    """Print what has become of a scenario's faults if an error ends the block before the motion has begun."""
    from steptwin.host.faults.report import NotBegunError

    try:
        yield
    except NotBegunError as error:
        document = error.scenario.to_dict()
        tell({"passed": False, **document}, lambda: print_faults(document), as_json=as_json)
        raise


def print_struck(document: Mapping[str, Any]) -> None:
    """Print a row for each fault of a live board, on which no plan says what is right; nothing without a scenario."""
    if "scenario" in document:
        rows = [[*_beginning(fault), str(fault["strikes"])] for fault in document["faults"]]
        print_table([*_COLUMNS, "strikes"], rows, text_columns=_TEXTS)


def raise_unless_struck(document: Mapping[str, Any]) -> None:
    """End the command with exit code 1 if a fault of a live board's scenario never struck."""
    never = [fault["name"] for fault in document.get("faults", ()) if fault["struck_s"] is None]
    if never:
        say(f"scenario {document['scenario']['name']}: never struck: {', '.join(never)}", err=True)
        raise typer.Exit(EXIT_NOT_VERIFIED)


_COLUMNS: Final = ("fault", "due", "answer", "struck s")
_TEXTS: Final = 3
_UNKNOWN: Final = "unknown after a reset"


def _beginning(fault: Mapping[str, Any]) -> list[str]:
    """Return the cells of _COLUMNS."""
    codes = " ".join(dict.fromkeys(told["code"] for told in fault["emcys"])) or "none"
    struck = "never" if fault["struck_s"] is None else f"{fault['struck_s']:.3f}"
    return [fault["name"], fault["due"], codes, struck]


def _struck(document: Mapping[str, Any]) -> int:
    return sum(fault["struck_s"] is not None for fault in document["faults"])


def _lost(fault: Mapping[str, Any]) -> str:
    lost = {name: joint["lost_steps"] for name, joint in fault["joints"].items()}
    if lost and all(steps is None for steps in lost.values()):
        return _UNKNOWN
    told = {name: _UNKNOWN if steps is None else fixed(steps, 0) for name, steps in lost.items() if steps != 0}
    return ", ".join(f"{name} {steps}" for name, steps in told.items()) or "0"
