"""The sentences for faults of a capture by path: axis, count, time and place."""

from typing import Final, NamedTuple

from steptwin.features.captures.motor_path import MotorPath
from steptwin.features.captures.path_faults import WHOLE, FaultKind, PathFault
from steptwin.features.captures.path_walk import Events
from steptwin.features.captures.step_rules import StepRule

HIDDEN: Final = "pulses that cancel before their axis turns around, such as one lost and one extra on the same line"
"""What a verdict that passed does not exclude."""


class Named(NamedTuple):
    """What sentences name."""

    names: tuple[str, ...]
    path: MotorPath
    events: Events
    rule: StepRule
    both_edges: bool


def window_s(events: Events, fault: PathFault) -> tuple[float, float]:
    """Return the instants of the last event surely before a fault and of the first surely behind it."""
    last = len(events.time_s) - 1
    begin, end = fault.events
    return float(events.time_s[min(max(begin - 1, 0), last)]), float(events.time_s[min(end, last)])


def sentence(fault: PathFault, named: Named) -> str:
    """Return the sentence for a fault."""
    axis, other = named.names[fault.axis], named.names[fault.other]
    where = "" if fault.kind in WHOLE else _where(fault, named)
    pulses = f"{axis} {_pulses(fault)} {where}: its count is off by {fault.steps:+d} from there on"
    return {
        FaultKind.LOST: pulses,
        FaultKind.EXTRA: pulses,
        FaultKind.LOST_OR_EXTRA: pulses,
        FaultKind.TURN: f"{axis} turns around {_off(fault)} {where}",
        FaultKind.END: f"{axis} ends {_off(fault)}",
        FaultKind.LEFT_OUT: f"the path is left out {where}",
        FaultKind.DETOUR: f"there is motion that the path does not have, {where}",
        FaultKind.LEAVES: f"the path is left {where}, and never reached again",
        FaultKind.UNFINISHED: f"the path is not finished: the steps end {where}",
        FaultKind.NOTHING: "no step is recorded, but the path needs some",
        FaultKind.DEAD: f"{axis} makes no step, but the path needs some: is its channel the right one?",
        FaultKind.SWAPPED: f"{axis} goes the path of {other}, and {other} that of {axis}: swap their channels",
        FaultKind.INVERTED: f"{axis} turns the other way: invert its DIR in --map{_belts(named)}",
        FaultKind.SCALED: (
            f"{axis} makes {fault.scale:.4g} times the planned steps: its microsteps or steps per unit differ"
            + ("; each edge was counted: leave out --both-edges" if named.both_edges and fault.scale > 1.9 else "")
        ),
        FaultKind.BOTH_EDGES: (
            "half of the planned steps on all axes, and STEP is as long high as low: the controller steps at both"
            " edges, as Klipper does with TMC drivers; --both-edges counts so"
        ),
        FaultKind.MORE: "there are more faults behind these",
    }[fault.kind]


def _belts(named: Named) -> str:
    """Return what else turns a motor of coupled axes the other way."""
    if not named.path.expected.coupling.matrix:
        return ""
    return "; of CoreXY the second motor goes y - x here, x - y with Klipper, grbl, Marlin and LinuxCNC"


def _pulses(fault: PathFault) -> str:
    count = abs(fault.steps)
    if fault.kind is FaultKind.LOST_OR_EXTRA:
        way = ("up", "down") if fault.steps < 0 else ("down", "up")
        return f"has lost {count} {_steps(count)} {way[0]}, or made {count} extra {way[1]},"
    way_word = "up" if fault.sign > 0 else "down"
    made = f"has lost {count}" if fault.kind is FaultKind.LOST else f"has made {count} extra"
    return f"{made} {_steps(count)} {way_word}"


def _steps(count: int) -> str:
    return "step" if count == 1 else "steps"


def _off(fault: PathFault) -> str:
    """Return by how much a count is off; one within a step of the plan is off by the rule alone."""
    if not fault.steps:
        return "within a step of the plan, but not where its step rule says"
    return f"{abs(fault.steps)} {_steps(abs(fault.steps))} {'above' if fault.steps > 0 else 'below'} the plan"


def _where(fault: PathFault, named: Named) -> str:
    """Return the time and the place of a fault."""
    begin_s, end_s = window_s(named.events, fault)
    if fault.pulse_s is not None:
        when = f"at {fault.pulse_s:.6f} s"
    elif end_s - begin_s < _INSTANT_S or fault.kind not in _WINDOWS:
        when = f"at {begin_s:.6f} s"
    else:
        when = f"between {begin_s:.6f} and {end_s:.6f} s"
    begin, end = fault.places
    path = named.path
    begin_mm, end_mm = path.mm_at(begin), path.mm_at(end)
    if begin_mm is None or end_mm is None:
        if fault.kind in _WINDOWS and path.words_at(begin) != path.words_at(end):
            return f"{when}, between {path.words_at(begin)} and {path.words_at(end)}"
        return f"{when}, at {path.words_at(begin)}"
    if fault.kind in _WINDOWS and end_mm - begin_mm >= _PLACE_MM:
        place = f"{begin_mm:.3f} to {end_mm:.3f} mm along the path, from {path.words_at(begin)}"
        return f"{when}, {place}"
    return f"{when}, {begin_mm:.3f} mm along the path, at {path.words_at(begin)}"


_INSTANT_S: Final = 1e-6
_PLACE_MM: Final = 1e-3
_WINDOWS: Final = (
    FaultKind.LOST,
    FaultKind.EXTRA,
    FaultKind.LOST_OR_EXTRA,
    FaultKind.LEFT_OUT,
    FaultKind.DETOUR,
)
"""Faults that lie between two instants and two places."""
