"""Programs of other controllers, written as programs of StepTwin: their motions and pauses, step by step.

A line that is no motion, or one that cannot be made from this line alone, stands as a comment where it stood, with the
reason, and is counted. Nothing is guessed: orientations have the convention of the program that wrote them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.planning.foreign import ar4, parol6
from steptwin.host.planning.foreign.line import LeftOut, ReadLine, TakenOver, text_of, value_text
from steptwin.host.planning.programs import parse_program
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import POSE
from steptwin.host.robots.robot import Robot

__all__ = ["LANGUAGES", "LINE_SPEED_MM_S", "Converted", "converted"]

LANGUAGES: Final[dict[str, Callable[[str, tuple[str, ...]], ReadLine]]] = {
    "ar4": ar4.read_line,
    "parol6": parol6.read_line,
}
"""How a line of each kind of program is read, with the names of the six joints."""

LINE_SPEED_MM_S: Final = 50.0
"""Speed of a straight move whose own program says a percentage or a time, unless another is asked for."""

_AXES: Final = 6


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
        body = "".join(f"{text_of(line, line_speed_mm_s)}\n" for line in lines)
        head = f"# {Path(path).name}: {len(taken)} lines are steps here, {len(left_out)} stand as comments.\n"
        made = f"{head}robot = {value_text(robot.name)}\n\n{body}"
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
