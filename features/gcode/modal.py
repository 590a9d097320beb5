"""What blocks of G-code let a machine do: moves, stops and outputs, by the words that hold from line to line."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, hypot, inf, pi
from typing import Final

from steptwin.features.gcode.blocks import GcodeBlock
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.planning.no_way import NO_WAY

Spot = tuple[float, float, float, float]
"""A place in the file's coordinates: x, y and z in mm and the turn in degrees."""

_INCH_MM: Final = 25.4
_OFF_MM, _OFF_PART, _OFF_MOST_MM = 0.005, 0.001, 0.5
"""How far both radii of an arc may differ: by the first, or by a part of the radius, but at most by the last.

So does grbl 1.1 (gcode.c, "Arc definition error"). LinuxCNC has the same form (interp_arc.cc, spiral_abs_tolerance and
spiral_rel_tolerance). Both keep the centre.
"""


@dataclass(frozen=True, slots=True)
class CornerMode:
    """How a tool path gets round its corners (G61, G64).

    Attributes:
        is_exact: True if it stops at each.
        passes_mm: distance at which it passes a corner at most; None for the program's own rounding.
        merge_mm: distance from a line within which short lines are taken for that one line; 0 for none.
    """

    is_exact: bool = False
    passes_mm: float | None = None
    merge_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class ArcShape:
    """An arc about the vertical: its centre in mm, its sweep in radians, counter-clockwise above 0.

    The radius grows evenly over the sweep, by `growth` as a part of that at its begin.
    """

    x_mm: float
    y_mm: float
    sweep_rad: float
    growth: float = 0.0


@dataclass(frozen=True, slots=True)
class RapidMove:
    """G0: a move of all joints to a place."""

    line: int
    goal: Spot


@dataclass(frozen=True, slots=True)
class CutMove:
    """G1, G2, G3: the tool leads from a place to another, on a line or an arc; `changes` are outputs at its begin."""

    line: int
    start: Spot
    goal: Spot
    feed_mm_s: float
    corner: CornerMode
    arc: ArcShape | None = None
    changes: tuple[tuple[str, bool], ...] = ()


@dataclass(frozen=True, slots=True)
class HomeMove:
    """G28: a move of all joints to the robot's home position."""

    line: int


@dataclass(frozen=True, slots=True)
class Dwell:
    """G4, M0 or M1: the machine comes to rest, and stands for so many seconds."""

    line: int
    time_s: float


@dataclass(frozen=True, slots=True)
class OutputWord:
    """An output, by the word that stands for it in the step's table, changes while the machine stands."""

    line: int
    key: str
    on: bool


GcodeAction = RapidMove | CutMove | HomeMove | Dwell | OutputWord


def actions(blocks: Sequence[GcodeBlock], start: Spot, home: Spot) -> Iterator[GcodeAction]:
    """Yield what the blocks do, from where the tool is; `home` is where G28 brings it.

    Raises InputError, with line and word, for words that do not fit together.
    """
    modal = _Modal(start, home)
    for block in blocks:
        with prefixed(f"line {block.line}: "):
            made = list(modal.take(block))
        yield from made
    yield from modal.left()


_MOTIONS: Final = ("G0", "G1", "G2", "G3")
_SPINDLE: Final = ("M3", "M4")
_COOLANT: Final = ("M7", "M8")
_AXES: Final = ("X", "Y", "Z", "A", "C")
_OF_ARCS: Final = ("I", "J", "K", "R")


@dataclass(slots=True)
class _Modal:
    """The words that hold from line to line."""

    here: Spot
    home: Spot
    motion: str = ""
    scale: float = 1.0
    """Millimetres of a unit."""
    is_relative: bool = False
    has_absolute_centres: bool = False
    feed_mm_s: float | None = None
    corner: CornerMode = field(default_factory=CornerMode)
    spindle: str = ""
    speed: float = inf
    """S; a spindle without any S turns."""
    on: set[str] = field(default_factory=set)
    """Outputs of spindle and coolant that are on."""
    waiting: list[tuple[str, bool]] = field(default_factory=list)
    """Outputs that change with the next motion (M62, M63)."""
    turning: str = ""
    """A or C, whichever turns the tool."""
    line: int = 0

    def take(self, block: GcodeBlock) -> Iterator[GcodeAction]:
        """Yield what a block does, in the order of RS274/NGC."""
        codes, numbers, self.line = block.codes, dict(block.numbers), block.line
        self._check_companions(codes, numbers)
        self._set_units(codes)
        if "F" in numbers:
            self._set_feed(numbers["F"])
        yield from self._turn_spindle(codes, numbers)
        if coolant := codes.get("coolant"):
            yield from self._switched(_COOLANT, set() if coolant == "M9" else (self.on & {*_COOLANT}) | {coolant})
        if output := codes.get("outputs"):
            yield from self._output(output, numbers["P"])
        if codes.get("single actions") == "G4":
            yield from self._stand(numbers["P"])
        if "distances" in codes:
            self.is_relative = codes["distances"] == "G91"
        if "centres of arcs" in codes:
            self.has_absolute_centres = codes["centres of arcs"] == "G90.1"
        if "corners" in codes:
            self._set_corners(codes["corners"], numbers)
        if codes.get("single actions") == "G28":
            yield from self._home()
        elif any(name in numbers for name in (*_AXES, *_OF_ARCS)) or "motion" in codes:
            yield from self._move(codes, numbers)
        if "stops" in codes:
            yield from self._stand(0.0)

    def left(self) -> Iterator[GcodeAction]:
        """Yield the changes of outputs that wait for a motion behind the last one."""
        for key, on in self.waiting:
            yield OutputWord(self.line, key, on)
        self.waiting.clear()

    def _check_companions(self, codes: Mapping[str, str], numbers: Mapping[str, float]) -> None:
        """Raise InputError for numbers that no code of the line takes, and codes without theirs."""
        takers = [code for code in (codes.get("single actions"), codes.get("outputs")) if code in _TAKE_P]
        takers += ["G64"] if codes.get("corners") == "G64" and "P" in numbers else []
        if len(takers) > 1:
            raise InputError(f"P: both {' and '.join(takers)} take it; write them in two lines")
        if "P" in numbers and not takers:
            raise InputError(f"P{numbers['P']:g}: no word of the line takes it")
        for code in takers:
            if "P" not in numbers:
                raise InputError(f"{code}: P is missing")
        if "P" in numbers and numbers["P"] < 0:
            raise InputError(f"P{numbers['P']:g}: is below 0")
        if "Q" in numbers and (codes.get("corners") != "G64" or numbers["Q"] < 0):
            raise InputError(f"Q{numbers['Q']:g}: goes with G64, and is not below 0")
        single = codes.get("single actions")
        others = [name for name in (*_AXES, *_OF_ARCS) if name in numbers]
        if single and (others or "motion" in codes):
            raise InputError(f"{single}: beside {(others or [codes['motion']])[0]}; it stands without motion words")
        if "A" in numbers and "C" in numbers:
            raise InputError("C: beside A; the tool has one turn")

    def _set_units(self, codes: Mapping[str, str]) -> None:
        if "units" in codes:
            self.scale = _INCH_MM if codes["units"] == "G20" else 1.0

    def _set_feed(self, feed: float) -> None:
        if not feed > 0:
            raise InputError(f"F{feed:g}: a feed is above 0")
        self.feed_mm_s = feed * self.scale / 60.0

    def _turn_spindle(self, codes: Mapping[str, str], numbers: Mapping[str, float]) -> Iterator[GcodeAction]:
        self.speed = numbers.get("S", self.speed)
        if self.speed < 0:
            raise InputError(f"S{self.speed:g}: a speed is not below 0")
        if codes.get("spindle"):
            self.spindle = "" if codes["spindle"] == "M5" else codes["spindle"]
        yield from self._switched(_SPINDLE, {self.spindle} if self.spindle and self.speed > 0 else set())

    def _set_corners(self, code: str, numbers: Mapping[str, float]) -> None:
        if code == "G61":
            self.corner = CornerMode(is_exact=True)
            return
        passes_mm = numbers["P"] * self.scale if "P" in numbers else None
        merge_mm = numbers["Q"] * self.scale if "Q" in numbers else passes_mm or 0.0
        self.corner = CornerMode(passes_mm=passes_mm, merge_mm=merge_mm)

    def _switched(self, group: Sequence[str], on: set[str]) -> Iterator[GcodeAction]:
        """Yield the changes by which just these of a group are on: off before on."""
        before = self.on & {*group}
        for key in sorted(before - on):
            yield OutputWord(self.line, key, on=False)
        for key in sorted(on - before):
            yield OutputWord(self.line, key, on=True)
        self.on = (self.on - {*group}) | on

    def _output(self, code: str, number: float) -> Iterator[GcodeAction]:
        if number != int(number):
            raise InputError(f"P{number:g}: the number of an output is whole")
        key, on = f"P{number:g}", code in ("M62", "M64")
        if code in ("M62", "M63"):
            self.waiting.append((key, on))
        else:
            yield OutputWord(self.line, key, on)

    def _stand(self, time_s: float) -> Iterator[GcodeAction]:
        yield Dwell(self.line, time_s)

    def _home(self) -> Iterator[GcodeAction]:
        yield from self.left()
        self.here = self.home
        yield HomeMove(self.line)

    def _move(self, codes: Mapping[str, str], numbers: Mapping[str, float]) -> Iterator[GcodeAction]:
        self.motion = codes.get("motion", self.motion)
        words = [name for name in (*_AXES, *_OF_ARCS) if name in numbers]
        if self.motion not in _MOTIONS:
            if words:
                raise InputError(f"{words[0]}{numbers[words[0]]:g}: no motion holds: G0, G1, G2 or G3 is missing")
            return
        is_arc = self.motion in ("G2", "G3")
        if not is_arc and (of_arc := [name for name in words if name in _OF_ARCS]):
            raise InputError(f"{of_arc[0]}{numbers[of_arc[0]]:g}: goes with G2 and G3, not with {self.motion}")
        if not words:  # the word alone, whose places follow
            return
        goal = self._goal(numbers)
        if self.motion == "G0":
            yield from self.left()
            yield RapidMove(self.line, goal)
        else:
            yield self._cut(goal, numbers, is_arc=is_arc)
        self.here = goal

    def _cut(self, goal: Spot, numbers: Mapping[str, float], *, is_arc: bool) -> CutMove:
        if self.feed_mm_s is None:
            raise InputError(f"{self.motion}: F is missing, the feed in mm a minute")
        move = CutMove(self.line, self.here, goal, self.feed_mm_s, self.corner, changes=tuple(self.waiting))
        self.waiting.clear()
        return replace(move, arc=self._arc(goal, numbers)) if is_arc else move

    def _goal(self, numbers: Mapping[str, float]) -> Spot:
        turning = next((name for name in ("A", "C") if name in numbers), None)
        if turning and self.turning not in ("", turning):
            raise InputError(f"{turning}{numbers[turning]:g}: {self.turning} turns the tool in a line before")
        self.turning = turning or self.turning
        spot = list(self.here)
        words = (("X", self.scale), ("Y", self.scale), ("Z", self.scale), (turning or "", 1.0))
        for i, (name, scale) in enumerate(words):
            if name in numbers:
                spot[i] = scale * numbers[name] + (spot[i] if self.is_relative else 0.0)
        x, y, z, turn_deg = spot
        return x, y, z, turn_deg

    # --- arcs

    def _arc(self, goal: Spot, numbers: Mapping[str, float]) -> ArcShape:
        (x, y), (x_goal, y_goal) = self.here[:2], goal[:2]
        if "R" in numbers:
            if both := [name for name in ("I", "J", "K") if name in numbers]:
                raise InputError(f"{both[0]}: beside R; an arc has a centre or a radius")
            centre = self._centre_by_radius((x, y), (x_goal, y_goal), numbers["R"] * self.scale)
        else:
            centre = self._centre((x, y), (x_goal, y_goal), numbers)
        spoke, last_spoke = (x - centre[0], y - centre[1]), (x_goal - centre[0], y_goal - centre[1])
        turn = 1.0 if self.motion == "G3" else -1.0
        sweep = (turn * (atan2(*last_spoke[::-1]) - atan2(*spoke[::-1]))) % (2.0 * pi)
        first, last = hypot(*spoke), hypot(*last_spoke)
        if min(sweep, 2.0 * pi - sweep) * first <= NO_WAY:
            sweep = 2.0 * pi
        return ArcShape(*centre, turn * sweep, (last - first) / first)

    def _centre(
        self, here: tuple[float, float], goal: tuple[float, float], numbers: Mapping[str, float]
    ) -> tuple[float, float]:
        """Return the centre of I and J; raise InputError if the arc's ends are not equally far from it."""
        if self.has_absolute_centres and not ("I" in numbers and "J" in numbers):
            raise InputError(f"{self.motion}: with G90.1 an arc has both I and J")
        if "I" not in numbers and "J" not in numbers:
            raise InputError(f"{self.motion}: an arc has I and J, or R")
        height = self.here[2] if self.has_absolute_centres else 0.0
        if "K" in numbers and abs(self.scale * numbers["K"] - height) > NO_WAY:
            raise InputError(f"K{numbers['K']:g}: an arc in G17 has its centre at the height of its start")
        base = (0.0, 0.0) if self.has_absolute_centres else here
        x, y = (base[i] + self.scale * numbers.get(name, 0.0) for i, name in enumerate("IJ"))
        first, last = hypot(here[0] - x, here[1] - y), hypot(goal[0] - x, goal[1] - y)
        for radius, ends in ((first, "begins"), (last, "ends")):
            if not radius > NO_WAY:
                raise InputError(f"{self.motion}: the centre is where the arc {ends}, to {NO_WAY:g} mm")
        if not abs(last - first) <= _off_max(first):
            raise InputError(
                f"{self.motion}: the arc begins {first:.6g} mm and ends {last:.6g} mm from its centre; they may differ"
                f" by {_off_max(first):.3g} mm"
            )
        return x, y

    def _centre_by_radius(
        self, here: tuple[float, float], goal: tuple[float, float], radius: float
    ) -> tuple[float, float]:
        way_x, way_y = goal[0] - here[0], goal[1] - here[1]
        chord = hypot(way_x, way_y)
        half = chord / 2
        if not chord > NO_WAY:
            raise InputError(f"R{radius / self.scale:g}: an arc that ends where it begins has I and J")
        if radius < 0 and NO_WAY * -radius > _OFF_MM * chord:
            raise InputError(
                f"R{radius / self.scale:g}: the arc ends {chord / self.scale:.3g} from where it begins, which does not"
                " say where its centre is: nearly a whole circle has I and J"
            )
        if half > abs(radius) + _off_max(abs(radius)):
            raise InputError(
                f"R{radius / self.scale:g}: is less than half the distance of the arc's ends, {half / self.scale:.6g}"
            )
        up = max(radius**2 - half**2, 0.0) ** 0.5 / (2 * half)
        left = (1.0 if radius > 0 else -1.0) * (1.0 if self.motion == "G3" else -1.0)
        return (here[0] + goal[0]) / 2 - left * up * way_y, (here[1] + goal[1]) / 2 + left * up * way_x


def _off_max(radius_mm: float) -> float:
    """Return by how much the radius at an arc's end may differ from that at its begin, in mm."""
    return max(_OFF_MM, min(_OFF_PART * radius_mm, _OFF_MOST_MM))


_TAKE_P: Final = ("G4", "M62", "M63", "M64", "M65")
"""Codes that a P word must stand beside."""
