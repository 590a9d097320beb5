"""Programs of other controllers, written as programs of StepTwin: their motions and pauses, step by step.

A line that is no motion, or one that cannot be made from this line alone, stands as a comment where it stood, with the
reason, and is counted. Nothing is guessed: orientations have the convention of the program that wrote them.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from steptwin.host.common.bad_input import prefixed, printable
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.findings import Findings
from steptwin.host.common.numbers import finite_number
from steptwin.host.common.own_files import read_text
from steptwin.host.planning.programs import parse_program
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import POSE
from steptwin.host.robots.poses.rotations import of_rotation_vector, product, rotation_vector_deg
from steptwin.host.robots.robot import Robot

LINE_SPEED_MM_S: Final = 50.0
"""Speed of a straight move whose own program says a percentage or a time, unless another is asked for."""

_AXES: Final = 6

_AR4_POSE: Final = ("X", "Y", "Z", "Rz", "Ry", "Rx")
_AR4_JOINTS: Final = ("J1", "J2", "J3", "J4", "J5", "J6")
_AR4_MOVES: Final = {"Move J": ("go", _AR4_POSE), "Move L": ("line", _AR4_POSE), "Move R": ("go", _AR4_JOINTS)}
_AR4_OTHER_AXES: Final = ("J7", "J8", "J9")
_AR4_PACES: Final = {"go": {"Sp": "speed_percent", "Ss": "duration_s"}, "line": {"Sm": "speed_mm_s"}}
_AR4_WAIT: Final = "Wait Time = "

_PAROL6_CALL: Final = re.compile(r"(\w+)\(([^()]*)\)")
_PAROL6_MOVES: Final = {"MoveJoint": "go", "MovePose": "go", "MoveCart": "line"}
_PAROL6_FRAME: Final = ("Begin", "End")
_PAROL6_WORDS: Final = ("trap", "poly", "speed")
_PAROL6_USUAL_PERCENT: Final = 45.0
"""Speed of a joint move that says neither a time nor v and a."""
_PAROL6_DECIMALS: Final = 6


@dataclass(frozen=True, slots=True)
class TakenOver:
    """A step.

    Attributes:
        keys: its keys and values, as a program has them.
        pace: what the line says about its speed, where that is none of the tool's; else empty.
    """

    keys: Mapping[str, Any]
    pace: str = ""

    @property
    def needs_speed(self) -> bool:
        """True for a straight move whose line says no speed of the tool."""
        return "line" in self.keys and "speed_mm_s" not in self.keys


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A line that is no step, as it was written, and why."""

    text: str
    why: str


@dataclass(frozen=True, slots=True)
class Remark:
    """A comment; an empty one is a line that says nothing."""

    text: str


ReadLine = TakenOver | LeftOut | Remark


def ar4_line(line: str, joints: tuple[str, ...]) -> ReadLine:
    """Return what a line of the AR4's programs, `.ar4`, is, as its HMI writes them.

        ## a comment
        Move J [*] X 300 Y 0 Z 300 Rz 180 Ry 0 Rx 0 J7 0 J8 0 J9 0 Sp 25 Ac 10 Dc 10 Rm 100 $ N
        Move L [*] ... Sm 50 Ac 10 Dc 10 Rm 100 Rnd 0 $ N
        Move R [*] J1 0 J2 0 J3 0 J4 0 J5 90 J6 0 J7 0 J8 0 J9 0 Sp 25 Ac 10 Dc 10 Rm 80 $ N
        Wait Time = .5

    Rz, Ry, Rx are no angles about axes one after the other: they are x, y, z of the rotation vector in degrees. Sp is a
    percentage, of the joints' speeds; Ss a time in seconds; Sm a speed of the tool in mm/s. The ramps Ac, Dc, Rm, the
    rounding Rnd and the wrist's letter behind $ are not taken over: a step has its own law, ends at rest, and keeps the
    arm's branch.

    Source: Annin-Robotics/ar4-hmi, commit 7ddbeb1 of 2025-10-19, AR4.py: what it inserts when a position is taught
    (line 6950 ff), how it reads that (3361 ff), and line 674, which gives the rotation vector's u, v, w to Rz, Ry, Rx.

    Raises:
        InputError: a number of a move is missing or none.
    """
    if line.startswith("##"):
        return Remark(line.strip("# "))
    if line.startswith(_AR4_WAIT):
        return TakenOver({"pause": finite_number(line.removeprefix(_AR4_WAIT))})
    head, star, rest = line.partition(" [*] ")
    if not star or head not in _AR4_MOVES:
        return LeftOut(line, "no motion that this line alone says" if star else "no motion")
    verb, names = _AR4_MOVES[head]
    with prefixed(f"{head}: "):
        values = _ar4_values(rest.partition("$")[0])
        if missing := [name for name in names if name not in values]:
            raise InputError(f"{missing[0]} is missing")
    if moved := [name for name in _AR4_OTHER_AXES if values.get(name)]:
        return LeftOut(line, f"{moved[0]} is an axis beside the arm")
    numbers = [values[name] for name in names]
    pose = dict(zip("xyz", numbers, strict=False)) | {"rotvec_deg": numbers[3:]}
    target = dict(zip(joints, numbers, strict=True)) if names is _AR4_JOINTS else pose
    pace = {key: values[name] for name, key in _AR4_PACES[verb].items() if name in values}
    said = " ".join(f"{name} {values[name]:g}" for name in ("Sp", "Ss", "Sm") if name in values)
    return TakenOver({verb: target, **pace}, "" if pace else said)


def _ar4_values(text: str) -> dict[str, float]:
    """Return the numbers of a move by the names before them."""
    words = text.split()
    if len(words) % 2:
        raise InputError(f"{words[-1]} has no number")
    values = {}
    for name, number in zip(words[::2], words[1::2], strict=True):
        with prefixed(f"{name}: "):
            values[name] = finite_number(number)
    return values


def parol6_line(line: str, joints: tuple[str, ...]) -> ReadLine:
    """Return what a line of the PAROL6's programs is, as its Commander writes and reads them.

        MoveJoint(89.2, -35.0, 174.4, -1.5, -28.6, 86.0, t=4)
        MovePose(x, y, z, rx, ry, rz, v=50, a=50)
        MoveCart(-40.5, 298.5, 131.7, 6.1, -0.7, -179.3, t=2, trap)
        Delay(1)

    The three angles are those of spatialmath's order 'xyz': R = Rx(third) Ry(second) Rz(first), about axes that turn
    along, not roll, pitch and yaw of ROS. A time t rules; without it v and a, percentages, both together; else the
    joints move at 45 %. The law `trap` or `poly`, the acceleration and the mark `speed` are not taken over.

    Source: PCrnjak/PAROL-commander-software, commit 295888e of 2025-08-09, GUI/files/Serial_sender_good_latest.py:
    patterns at lines 605, 935, 1274; SE3.RPY(..., order='xyz') at 968 and 1312; v_value = 45 at 780.

    Raises:
        InputError: a number of a move is missing or none.
    """
    call = _PAROL6_CALL.fullmatch(line)
    name = call[1] if call else ""
    if call is None or name not in (*_PAROL6_MOVES, *_PAROL6_FRAME, "Delay"):
        return LeftOut(line, "no motion")
    words = [word.strip() for word in call[2].split(",")] if call[2].strip() else []
    with prefixed(f"{name}: "):
        if name in _PAROL6_FRAME:
            return Remark("")
        if name == "Delay":
            return TakenOver({"pause": _parol6_numbers(words, 1)[0]})
        numbers = _parol6_numbers(words, len(joints))
        target = dict(zip(joints, numbers, strict=True)) if name == "MoveJoint" else _parol6_pose(numbers)
        return _parol6_step(_PAROL6_MOVES[name], target, _parol6_paces(words[len(joints) :]))


def _parol6_numbers(words: list[str], count: int) -> list[float]:
    if len(words) < count:
        raise InputError(f"has {len(words)} numbers, it takes {count}")
    return [finite_number(word) for word in words[:count]]


def _parol6_paces(words: list[str]) -> dict[str, float]:
    """Return t, v and a, as far as they are given above 0."""
    paces: dict[str, float] = {}
    for word in words:
        key, equals, number = word.replace(" ", "").partition("=")
        if not equals and key in _PAROL6_WORDS:
            continue
        if key not in ("t", "v", "a"):
            raise InputError(f"{word!r} is none of t=, v=, a=, {', '.join(_PAROL6_WORDS)}")
        with prefixed(f"{key}="):
            paces[key] = finite_number(number)
    return {key: value for key, value in paces.items() if value > 0.0}


def _parol6_step(verb: str, target: Mapping[str, Any], paces: dict[str, float]) -> TakenOver:
    if verb == "line":
        return TakenOver({verb: target}, " ".join(f"{key}={value:g}" for key, value in paces.items()) or "no speed")
    if "t" in paces:
        return TakenOver({verb: target, "duration_s": paces["t"]})
    percent = paces["v"] if {"v", "a"} <= paces.keys() else _PAROL6_USUAL_PERCENT
    return TakenOver({verb: target, "speed_percent": percent})


def _parol6_pose(numbers: list[float]) -> dict[str, Any]:
    """Return the pose of x, y, z in mm and the three angles."""
    about_z, about_y, about_x = of_rotation_vector(np.diag(numbers[3:])[:, ::-1])
    vector = rotation_vector_deg(product(about_x, product(about_y, about_z)))
    return {
        **dict(zip("xyz", numbers, strict=False)),
        "rotvec_deg": (np.round(vector, _PAROL6_DECIMALS) + 0.0).tolist(),
    }


LANGUAGES: Final[dict[str, Callable[[str, tuple[str, ...]], ReadLine]]] = {
    "ar4": ar4_line,
    "parol6": parol6_line,
}
"""How a line of each kind of program is read, with the names of the six joints."""


@dataclass(frozen=True, slots=True)
class Converted:
    """A program as StepTwin has it.

    Attributes:
        text: the TOML text.
        taken: number of lines that are steps now.
        left_out: each line that is not, as it was written.
        own_speeds: number of straight moves at the speed that was asked for.
    """

    text: str
    taken: int
    left_out: tuple[str, ...]
    own_speeds: int


def converted(path: str, language: str, robot: Robot, line_speed_mm_s: float = LINE_SPEED_MM_S) -> Converted:
    """Return a program of another controller as one of StepTwin for a robot, which is not asked whether it can do it.

    Args:
        path: Name of the file.
        language: One of LANGUAGES.
        robot: An arm of six joints whose tool takes whole poses; the program's joints are its own, in order.
        line_speed_mm_s: Speed of straight moves whose own speed is no speed of the tool.

    Raises:
        InputError: the file cannot be read or no line of it is a motion, a line has a wrong number, or the robot is no
            such arm.
    """
    if len(robot.joints) != _AXES or make_kinematics(robot).task is not POSE:
        raise InputError(f"{robot.name}: such a program is for an arm of six joints whose tool turns in space")
    if not line_speed_mm_s > 0.0:
        raise InputError(f"line_speed_mm_s={line_speed_mm_s:g}: is not above 0")
    with prefixed(f"{path}: "):
        text = read_text(path, PROGRAM_BYTES_MAX)
        lines = list(_read(text, LANGUAGES[language], robot.joint_names))
        taken = [line for line in lines if isinstance(line, TakenOver)]
        if not taken:
            raise InputError(f"has no motion of a program of the kind {language!r}")
        left_out = tuple(line.text for line in lines if isinstance(line, LeftOut))
        body = "".join(f"{_text_of(line, line_speed_mm_s)}\n" for line in lines)
        head = f"# {Path(path).name}: {len(taken)} lines are steps here, {len(left_out)} stand as comments.\n"
        made = f"{head}robot = {_value_text(robot.name)}\n\n{body}"
        findings = Findings()
        parse_program(made, findings)
        findings.raise_first()
    return Converted(made, len(taken), left_out, sum(line.needs_speed for line in taken))


def _read(
    text: str, read_line: Callable[[str, tuple[str, ...]], ReadLine], joints: tuple[str, ...]
) -> Iterator[ReadLine]:
    for i, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            with prefixed(f"line {i}: "):
                yield read_line(line.strip(), joints)


def _text_of(line: ReadLine, line_speed_mm_s: float) -> str:
    """Return the text of a line in a program; the speed is that of a straight move without its own."""
    match line:
        case TakenOver(keys, pace):
            speed = {"speed_mm_s": line_speed_mm_s} if line.needs_speed else {}
            rows = [f"{key} = {_value_text(each)}" for key, each in (dict(keys) | speed).items()]
            there = f"  # there: {printable(pace)}" if pace else ""
            return "\n".join(["[[step]]", *rows]) + there
        case LeftOut(text, why):
            return f"# left out, {why}: {printable(text)}"
        case Remark(text):
            return f"# {printable(text)}" if text else ""


def _value_text(value: object) -> str:
    """Return the TOML text of a number, a text, a list or a table."""
    match value:
        case dict():
            return f"{{ {', '.join(f'{key} = {_value_text(each)}' for key, each in value.items())} }}"
        case list():
            return f"[{', '.join(map(_value_text, value))}]"
        case str():
            return json.dumps(value, ensure_ascii=False)  # TOML escapes as JSON does
    return repr(value)
