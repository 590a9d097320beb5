"""Count verdicts by path on made captures, right and wrong: `python -m steptwin.bench.path_verdicts [CLEAN FAULTY]`.

Each capture has a path, a speed law, a controller, a sampling rate, a drift and jitter of its own, drawn by its number.
A third of the captures is judged without the controller's name. Of the faults that cancel no path can tell.
"""

import sys
from collections import Counter
from time import process_time
from typing import Final

import numpy as np
from rich.console import Console

from steptwin.bench import bench_table
from steptwin.features.captures.path_faults import FaultKind
from steptwin.features.captures.path_verdict import PathVerdict, judge_path
from steptwin.features.captures.step_rules import CONTROLLERS, ESTIMATES, Rest, StepRule
from steptwin.host.common.arrays import FloatArray
from tests.features.captures.drawn import CANCELLING, FAULTS, Case, made_case

_FIRST_SEED: Final = 100_000
_WITHIN_S: Final = 0.002


def verdict(case: Case, *, named: bool) -> PathVerdict:
    """Return the verdict on a capture, held to its own rule, or to the rule that is estimated."""
    rules: dict[str, StepRule] = {each.name: each for each in (*ESTIMATES, *CONTROLLERS.values())}
    return judge_path(case.signals, case.expected, rules[case.rule] if named else None, case.resolution_s)


def located(case: Case, found: PathVerdict) -> bool:
    """Return whether the first fault names the axis, the count and the time."""
    fault, (axis, off, at_s) = found.faults[0], case.place
    begin_s, end_s = found.window_s(fault)
    in_time = begin_s - _WITHIN_S <= at_s + 0.01 <= end_s + _WITHIN_S
    return (fault.axis, fault.steps) == (axis, off) and in_time and len(found.faults) == 1


def main(clean: int = 500, faulty: int = 1000) -> None:
    """Print how many clean captures pass, and what is said of the others."""
    begun_s = process_time()
    rows: list[str] = []
    wrong: list[str] = []
    passed = 0
    for seed in range(_FIRST_SEED, _FIRST_SEED + clean):
        passed += (found := verdict(made_case(seed), named=seed % 3 > 0)).passed
        if not found.passed:
            wrong.append(f"clean {seed}: {found.reasons[0]}")
    rows.append(f"none|{clean}|{clean - passed}|-|-|{clean - passed}")
    counted, failed, named, untold, misjudged = (Counter[str]() for _ in range(5))
    kinds = (*FAULTS, *CANCELLING)
    for number in range(faulty):
        kind, seed = kinds[number % len(kinds)], _FIRST_SEED + clean + number
        case = made_case(seed, kind)
        found = verdict(case, named=seed % 3 > 0)
        counted[kind] += 1
        failed[kind] += not found.passed
        untold[kind] += found.passed and _untold(kind, found)
        named[kind] += not found.passed and _names(kind, case, found)
        if found.passed and not _untold(kind, found):
            misjudged[kind] += 1
            wrong.append(f"{kind} {seed} of {case.rule}: passed by {found.rule.name}")
    for kind in kinds:
        rows.append(f"{kind}|{counted[kind]}|{failed[kind]}|{named[kind]}|{untold[kind]}|{misjudged[kind]}")
    console = Console()
    console.print(bench_table("Made captures, by path", "fault|captures|failed|named|cannot be told|wrong", rows))
    for line in wrong:
        console.print(line)
    console.print(f"{process_time() - begun_s:.0f} s of processor time")


def _untold(kind: str, found: PathVerdict) -> bool:
    """Return True if a fault leaves no trace in the path: its pulses cancel, or the rule allows both counts."""
    ends_between = found.rule.rest is Rest.WHOLE and bool((np.abs(_fractions(found)) > 0.01).any())
    return kind in CANCELLING or (kind in ("lost 1", "extra 1", "two axes lose 1") and ends_between)


def _fractions(found: PathVerdict) -> FloatArray:
    ends = found.path.points[:, -1]
    return np.asarray(ends - np.rint(ends))


def _names(kind: str, case: Case, found: PathVerdict) -> bool:
    first = found.faults[0].kind
    if kind in ("swapped", "inverted", "scaled", "dead"):
        if len(case.signals) == 1 and kind == "dead":
            return first is FaultKind.NOTHING
        said = {"swapped": FaultKind.SWAPPED, "inverted": FaultKind.INVERTED, "scaled": FaultKind.SCALED}
        return first is said.get(kind, FaultKind.DEAD)
    if kind == "stroke left out":
        return first in (FaultKind.LEFT_OUT, FaultKind.LEAVES)
    if kind in ("two axes lose 1", *CANCELLING):
        return {fault.kind for fault in found.faults} <= {FaultKind.LOST, FaultKind.EXTRA, FaultKind.LOST_OR_EXTRA}
    return located(case, found)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
