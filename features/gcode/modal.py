"""What blocks of G-code let a machine do: moves, stops and outputs, by the words that hold from line to line."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2, dist, hypot, inf, pi
from typing import Final

from steptwin.features.gcode.biarcs import Flat, spline_arcs
from steptwin.features.gcode.blocks import REFUSALS_MAX, GcodeBlock
from steptwin.features.gcode.cycles import CYCLES, DWELLING, PECKING, Drilling
from steptwin.features.gcode.dialects import MANNERS, Manners
from steptwin.features.gcode.origins import Origins, Spot, replaced
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.no_way import NO_WAY

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
    """An arc: its centre in its plane in mm, its sweep in radians, counter-clockwise above 0.

    The radius grows evenly over the sweep, by `growth` as a part of that at its begin. The plane is that of two axes by
    their numbers, seen from the end of the third one: x and y (G17), z and x (G18), or y and z (G19).
    """

    x_mm: float
    y_mm: float
    sweep_rad: float
    growth: float = 0.0
    plane: tuple[int, int] = (0, 1)


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


def actions(
    blocks: Sequence[GcodeBlock],
    start: Spot,
    home: Spot,
    manners: Manners = MANNERS[None],
    corner: CornerMode | None = None,
) -> list[GcodeAction]:
    """Return what the blocks do, from where the tool is.

    Args:
        blocks: the lines of a file.
        start: place of the tool.
        home: place to which G28 leads.
        manners: those of the file's dialect.
        corner: how the path gets round corners before G61 or G64, and by G64 without P.

    Raises:
        InputError: words do not fit together; the messages have line and word, the first REFUSALS_MAX are told.
    """
    modal = _Modal(start, home, manners, corner or CornerMode(), manners.motion)
    wrong, found = Findings(), list[GcodeAction]()
    for block in blocks:
        with wrong.collecting(f"line {block.line}: "):
            found.extend(modal.take(block))
        if len(wrong.messages) >= REFUSALS_MAX:
            break
    wrong.raise_first()
    return [*found, *modal.left()]


_MOTIONS: Final = ("G0", "G1", "G2", "G3")
_SPINDLE: Final = ("M3", "M4")
_COOLANT: Final = ("M7", "M8")
_AXES: Final = ("X", "Y", "Z", "A", "C")
_OF_ARCS: Final = ("I", "J", "K", "R")
_CURVES: Final = ("G5", "G5.1")
_TAKE_AXES: Final = ("G10", "G28", "G30", "G52", "G92")
"""Single actions that axis words may stand beside."""
_HOLES_MAX: Final = 10_000
"""Repetitions of a cycle."""
_PLANES: Final = {"G17": (0, 1), "G18": (2, 0), "G19": (1, 2)}


@dataclass(slots=True)
class _Modal:
    """The words that hold from line to line."""

    here: Spot
    """Place in the machine's coordinates: those of the step's frame."""
    home: Spot
    manners: Manners
    usual_corner: CornerMode
    """Corners without a tolerance of the file."""
    motion: str
    """The motion that holds."""
    plane: tuple[int, int] = (0, 1)
    origins: Origins = field(default_factory=Origins)
    places: dict[str, Spot] = field(default_factory=dict)
    """Places of G28 and G30 that the file has stored."""
    is_inverse: bool = False
    """True if F is the reciprocal of a move's duration in minutes (G93)."""
    feed_factor: float = 1.0
    hole: dict[str, float] = field(default_factory=dict)
    """Z, R, Q and P of a drilling cycle, which hold for further holes."""
    clear_mm: float | None = None
    """Height at the begin of cycles in a row, at which each ends (G98); None without a cycle."""
    ends_at_r: bool = False
    """True if cycles end at the height R (G99)."""
    curve_end: Flat | None = None
    """P and Q of a cubic spline, which the next one continues."""
    scale: float = 1.0
    """Millimetres of a unit."""
    is_relative: bool = False
    has_absolute_centres: bool = False
    feed_mm_s: float | None = None
    corner: CornerMode | None = None
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
        single = codes.get("single actions", "")
        self._check_companions(codes, numbers)
        self._set_modes(codes, numbers)
        if "F" in numbers:
            self._set_feed(numbers["F"])
        if "feed factor" in codes and "S" in numbers:
            self.feed_factor = numbers.pop("S") / 100.0
        yield from self._turn_spindle(codes, numbers)
        if coolant := codes.get("coolant"):
            yield from self._switched(_COOLANT, set() if coolant == "M9" else (self.on & {*_COOLANT}) | {coolant})
        if output := codes.get("outputs"):
            yield from self._output(output, numbers["P"])
        if single == "G4":
            time_s = numbers["P"] * self.manners.dwell_s if "P" in numbers else numbers["S"]
            yield from self._stand(time_s)
        if "corners" in codes:
            self._set_corners(codes["corners"], numbers)
        if single in ("G28", "G30", "$H"):
            yield from self._home(single, numbers)
        elif single in ("G28.1", "G30.1"):
            self.places[single[:3]] = self.here
        elif single[:3] in ("G10", "G52", "G92"):
            self._set_origin(single, numbers)
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
        single, corners = codes.get("single actions"), codes.get("corners")
        takers = [code for code in (single, codes.get("outputs")) if code in _TAKE_P]
        takers += ["G64"] if corners == "G64" and "P" in numbers else []
        motion = codes.get("motion", self.motion)
        takers += [motion] if motion in ("G5", *DWELLING) and "P" in numbers and not takers else []
        if len(takers) > 1:
            raise InputError(f"P: both {' and '.join(takers)} take it; write them in two lines")
        if "P" in numbers and not takers:
            raise InputError(f"P{numbers['P']:g}: no word of the line takes it")
        for code in takers:
            if "P" not in numbers and not (code == "G4" and self.manners.one_command and "S" in numbers):
                raise InputError(f"{code}: P is missing")
        if "P" in numbers and numbers["P"] < 0 and takers != ["G5"]:
            raise InputError(f"P{numbers['P']:g}: is below 0")
        if "Q" in numbers and motion not in (*_CURVES, *PECKING) and (corners != "G64" or numbers["Q"] < 0):
            raise InputError(f"Q{numbers['Q']:g}: goes with G64, and is not below 0")
        if "L" in numbers and single != "G10" and motion not in CYCLES:
            raise InputError(f"L{numbers['L']:g}: goes with G10 and cycles")
        others = [name for name in (*_AXES, *_OF_ARCS) if name in numbers]
        if single in _TAKE_AXES and not (single == "G28" and self.manners.is_strict):
            others = [name for name in others if name in _OF_ARCS and (name, single) != ("R", "G10")]
        alone = single and not (single == "G4" and not self.manners.is_strict)
        if alone and (others or "motion" in codes):
            raise InputError(f"{single}: beside {(others or [codes['motion']])[0]}; it stands without motion words")
        if "A" in numbers and "C" in numbers:
            raise InputError("C: beside A; the tool has one turn")

    def _set_modes(self, codes: Mapping[str, str], numbers: dict[str, float]) -> None:
        """Take the words that only change how others are read."""
        if "units" in codes:
            self.scale = _INCH_MM if codes["units"] == "G20" else 1.0
        if "plane" in codes:
            self.plane = _PLANES[codes["plane"]]
        if "feed" in codes and self.is_inverse != (codes["feed"] == "G93"):
            self.is_inverse, self.feed_mm_s = codes["feed"] == "G93", None
        if "distances" in codes:
            self.is_relative = codes["distances"] == "G91"
        if "centres of arcs" in codes:
            self.has_absolute_centres = codes["centres of arcs"] == "G90.1"
        if "coordinates" in codes:
            self.origins.select(codes["coordinates"])
        self.ends_at_r = codes["retraction"] == "G99" if "retraction" in codes else self.ends_at_r
        if codes.get("length of the tool") == "G49":
            self.origins.set_length(0.0)
        elif "length of the tool" in codes:
            if "Z" not in numbers:
                raise InputError("G43.1: Z is missing, the tool's length")
            self.origins.set_length(self.scale * numbers.pop("Z"))

    def _set_origin(self, code: str, numbers: Mapping[str, float]) -> None:
        """Move the origin: G92, G52, and G10 with L2 or L20."""
        origins = self.origins
        if code in ("G92.1", "G92.2", "G92.3"):
            origins.end_shift(code)
        elif code == "G10":
            origins.set_system(numbers, self._places(code, numbers), self.here)
        else:
            origins.set_shift(code, self._places(code, numbers), self.here)

    def _places(self, code: str, numbers: Mapping[str, float]) -> dict[int, float]:
        """Return the axis words of a line, in mm and degrees, by the number of the axis."""
        axes = (("X", self.scale), ("Y", self.scale), ("Z", self.scale), ("A", 1.0), ("C", 1.0))
        found = {min(i, 3): scale * numbers[name] for i, (name, scale) in enumerate(axes) if name in numbers}
        if not found:
            raise InputError(f"{code}: no axis word; there are {' '.join(_AXES)}")
        return found

    def _set_feed(self, feed: float) -> None:
        if not feed > 0:
            raise InputError(f"F{feed:g}: a feed is above 0")
        self.feed_mm_s = feed / 60.0 if self.is_inverse else feed * self.scale / 60.0

    def _turn_spindle(self, codes: Mapping[str, str], numbers: Mapping[str, float]) -> Iterator[GcodeAction]:
        self.speed = numbers.get("S", self.speed)
        if self.speed < 0:
            raise InputError(f"S{self.speed:g}: a speed is not below 0")
        if codes.get("spindle"):
            self.spindle = "" if codes["spindle"] == "M5" else codes["spindle"]
        yield from self._switched(_SPINDLE, {self.spindle} if self.spindle and self.speed > 0 else set())

    def _set_corners(self, code: str, numbers: Mapping[str, float]) -> None:
        if code in ("G61", "G61.1"):
            self.corner = CornerMode(is_exact=True)
            return
        if "P" not in numbers and "Q" not in numbers and not self.manners.is_strict:
            self.corner = None
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

    def _home(self, code: str, numbers: Mapping[str, float]) -> Iterator[GcodeAction]:
        """Go to the place of G28 or G30: all axes, or those that are named.

        A printer homes them, which ends their offset. Another controller goes first where the axis words lead.
        """
        yield from self.left()
        named = [i for i, name in enumerate("XYZ") if name in numbers]
        place = self.places.get(code, self.home)
        if self.manners.one_command:
            self.origins.end_shift_of(named or range(4))
        elif named:
            self.here = self._goal(numbers)
            yield RapidMove(self.line, self.here)
        if named:
            self.here = replaced(self.here, {i: place[i] for i in named})
        else:
            self.here = place
        if named or code in self.places:
            yield RapidMove(self.line, self.here)
        else:
            yield HomeMove(self.line)

    def _move(self, codes: Mapping[str, str], numbers: Mapping[str, float]) -> Iterator[GcodeAction]:
        self.motion = codes.get("motion", self.motion)
        words = [name for name in (*_AXES, *_OF_ARCS) if name in numbers]
        if self.motion in CYCLES:
            yield from self._drill(numbers, is_new="motion" in codes)
            return
        self.clear_mm = None
        if self.motion not in (*_MOTIONS, *_CURVES):
            if words:
                raise InputError(f"{words[0]}{numbers[words[0]]:g}: no motion holds: G0, G1, G2 or G3 is missing")
            return
        is_arc = self.motion in ("G2", "G3")
        if self.motion in ("G0", "G1") and (of_arc := [name for name in words if name in _OF_ARCS]):
            raise InputError(f"{of_arc[0]}{numbers[of_arc[0]]:g}: goes with G2 and G3, not with {self.motion}")
        if not words:  # the word alone, whose places follow
            return
        in_machine = "machine coordinates" in codes
        if in_machine and (self.motion not in ("G0", "G1") or self.is_relative):
            raise InputError(f"G53: goes with G0 and G1, in absolute places, not with {self.motion}")
        goal = self._goal(numbers, in_machine=in_machine)
        if self.motion == "G0" and not self.manners.one_command:
            yield from self.left()
            yield RapidMove(self.line, goal)
        elif self.motion in _CURVES:
            yield from self._curve(goal, numbers)
        else:
            yield self._cut(goal, numbers, is_arc=is_arc)
        if self.motion != "G5":
            self.curve_end = None
        self.here = goal

    def _cut(self, goal: Spot, numbers: Mapping[str, float], *, is_arc: bool) -> CutMove:
        arc = self._arc(goal, numbers) if is_arc else None
        return self._leading(self.here, goal, arc, self._feed(numbers, _length_mm(self.here, goal, arc)))

    def _feed(self, numbers: Mapping[str, float], length_mm: float) -> float:
        """Return the feed of a move in mm/s."""
        if self.is_inverse:
            if "F" not in numbers:
                raise InputError(f"{self.motion}: F is missing; with G93 each move has its own")
            return numbers["F"] / 60.0 * max(length_mm, NO_WAY)
        feed_mm_s = self.feed_mm_s or self.manners.feed_mm_s
        if feed_mm_s is None:
            raise InputError(f"{self.motion}: F is missing, the feed in mm a minute")
        return feed_mm_s * self.feed_factor

    def _leading(self, start: Spot, goal: Spot, arc: ArcShape | None, feed_mm_s: float) -> CutMove:
        corner = self.usual_corner if self.corner is None else self.corner
        move = CutMove(self.line, start, goal, feed_mm_s, corner, arc, tuple(self.waiting))
        self.waiting.clear()
        return move

    def _goal(self, numbers: Mapping[str, float], *, in_machine: bool = False) -> Spot:
        turning = next((name for name in ("A", "C") if name in numbers), None)
        if turning and self.turning not in ("", turning):
            raise InputError(f"{turning}{numbers[turning]:g}: {self.turning} turns the tool in a line before")
        self.turning = turning or self.turning
        spot = list(self.here)
        words = (("X", self.scale), ("Y", self.scale), ("Z", self.scale), (turning or "", 1.0))
        for i, (name, scale) in enumerate(words):
            if name in numbers:
                base = spot[i] if self.is_relative else 0.0 if in_machine else self.origins.total[i]
                spot[i] = scale * numbers[name] + base
        x, y, z, turn_deg = spot
        return x, y, z, turn_deg

    # --- cycles

    def _drill(self, numbers: Mapping[str, float], *, is_new: bool) -> Iterator[GcodeAction]:
        """Yield the moves of a drilling cycle, and of its repetitions."""
        code, times = self.motion, numbers.get("L", 1.0)
        if self.plane != (0, 1) or self.is_inverse:
            raise InputError(f"{code}: a cycle is along z, with G17 and G94")
        if times not in range(1, _HOLES_MAX + 1):
            raise InputError(f"L{times:g}: a number of repetitions is from 1 to {_HOLES_MAX}")
        if is_new:
            self.hole = {}
        self.hole |= {name: numbers[name] for name in "ZRQP" if name in numbers}
        if missing := [name for name in "ZR" if name not in self.hole]:
            raise InputError(f"{code}: {missing[0]} is missing")
        bottom, above = self.scale * self.hole["Z"], self.scale * self.hole["R"]
        if self.clear_mm is None:
            self.clear_mm = self.here[2]
        from_mm = above + (self.here[2] if self.is_relative else self.origins.total[2])
        to_mm = bottom + (from_mm if self.is_relative else self.origins.total[2])
        hole = Drilling(
            code,
            from_mm,
            to_mm,
            from_mm if self.ends_at_r else max(self.clear_mm, from_mm),
            self.scale * self.hole.get("Q", 0.0),
            self.hole.get("P", 0.0) if code in DWELLING else 0.0,
        )
        beside = {name: value for name, value in numbers.items() if name in ("X", "Y", "A", "C")}
        yield from self.left()
        if self.here[2] < from_mm:
            yield from self._stroke(from_mm, is_rapid=True)
        for _ in range(int(times)):
            self.here = self._goal(beside)
            yield RapidMove(self.line, self.here)
            yield from self._stroke(from_mm, is_rapid=True)
            for stroke in hole.strokes():
                if stroke.dwell_s:
                    yield from self._stand(stroke.dwell_s)
                else:
                    yield from self._stroke(stroke.height_mm, is_rapid=stroke.is_rapid)

    def _stroke(self, height_mm: float, *, is_rapid: bool) -> Iterator[GcodeAction]:
        """Yield a move along z, if there is one."""
        start, self.here = self.here, replaced(self.here, {2: height_mm})
        if start == self.here:
            return
        if is_rapid:
            yield RapidMove(self.line, self.here)
        else:
            yield self._leading(start, self.here, None, self._feed({}, 0.0))

    # --- splines

    def _curve(self, goal: Spot, numbers: Mapping[str, float]) -> Iterator[CutMove]:
        """Yield the arcs and lines of a spline by I, J and, for a cubic one, P and Q."""
        if self.plane != (0, 1) or goal[2:] != self.here[2:]:
            raise InputError(f"{self.motion}: a spline is in the x-y plane")
        begin, end = Flat(*self.here[:2]), Flat(*goal[:2])
        first = Flat(self.scale * numbers.get("I", 0.0), self.scale * numbers.get("J", 0.0))
        if self.motion == "G5":
            if not {"P", "Q"} <= numbers.keys():
                raise InputError("G5: P and Q are missing, which say where its end comes from")
            last = Flat(self.scale * numbers["P"], self.scale * numbers["Q"])
            if not {"I", "J"} & numbers.keys():
                if self.curve_end is None:
                    raise InputError("G5: I and J are missing, which say where its begin leads")
                first = Flat(-self.curve_end.x, -self.curve_end.y)
            self.curve_end = last
            controls = (Flat(begin.x + first.x, begin.y + first.y), Flat(end.x + last.x, end.y + last.y))
        else:
            if not {"I", "J"} & numbers.keys():
                raise InputError("G5.1: I and J are missing, its control point")
            middle = Flat(begin.x + first.x, begin.y + first.y)
            controls = (
                Flat((begin.x + 2 * middle.x) / 3, (begin.y + 2 * middle.y) / 3),
                Flat((end.x + 2 * middle.x) / 3, (end.y + 2 * middle.y) / 3),
            )
        pieces = spline_arcs(begin, *controls, end)
        shapes = [(piece.goal, ArcShape(*piece.centre, piece.sweep_rad) if piece.centre else None) for piece in pieces]
        legs, here = list[tuple[Spot, Spot, ArcShape | None]](), self.here
        for place, shape in shapes:
            legs.append((here, (*place, *goal[2:]), shape))
            here = legs[-1][1]
        feed_mm_s = self._feed(numbers, sum(_length_mm(*leg) for leg in legs))
        for leg in legs:
            yield self._leading(*leg, feed_mm_s)

    # --- arcs

    def _arc(self, goal: Spot, numbers: Mapping[str, float]) -> ArcShape:
        u, v = self.plane
        (x, y), (x_goal, y_goal) = (self.here[u], self.here[v]), (goal[u], goal[v])
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
        return ArcShape(*centre, turn * sweep, (last - first) / first, self.plane)

    def _centre(
        self, here: tuple[float, float], goal: tuple[float, float], numbers: Mapping[str, float]
    ) -> tuple[float, float]:
        """Return the centre by I, J and K; raise InputError if the arc's ends are not equally far from it."""
        normal = 3 - sum(self.plane)
        plane = next(code for code, axes in _PLANES.items() if axes == self.plane)
        names, beside = ["IJK"[i] for i in sorted(self.plane)], "IJK"[normal]
        if self.has_absolute_centres and not all(name in numbers for name in names):
            raise InputError(f"{self.motion}: with G90.1 an arc has both {' and '.join(names)}")
        if not any(name in numbers for name in names):
            raise InputError(f"{self.motion}: an arc has {' and '.join(names)}, or R")
        height = self.here[normal] - self.origins.total[normal] if self.has_absolute_centres else 0.0
        if beside in numbers and abs(self.scale * numbers[beside] - height) > NO_WAY:
            raise InputError(
                f"{beside}{numbers[beside]:g}: an arc in {plane} has its centre at the height of its start"
            )
        base = [self.origins.total[i] for i in self.plane] if self.has_absolute_centres else here
        x, y = (base[i] + self.scale * numbers.get("IJK"[axis], 0.0) for i, axis in enumerate(self.plane))
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


def _length_mm(start: Spot, goal: Spot, arc: ArcShape | None) -> float:
    """Return the length of a line, an arc or a helix."""
    if arc is None:
        return dist(start[:3], goal[:3])
    (u, v), normal = arc.plane, 3 - sum(arc.plane)
    radius = hypot(start[u] - arc.x_mm, start[v] - arc.y_mm) * (1.0 + arc.growth / 2.0)
    return hypot(radius * arc.sweep_rad, goal[normal] - start[normal])


_TAKE_P: Final = ("G4", "G10", "M62", "M63", "M64", "M65")
"""Codes that a P word must stand beside."""
