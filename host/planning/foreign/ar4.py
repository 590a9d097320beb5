"""Lines of the AR4's programs, `.ar4`, as its HMI writes them.

    ## a comment
    Move J [*] X 300 Y 0 Z 300 Rz 180 Ry 0 Rx 0 J7 0 J8 0 J9 0 Sp 25 Ac 10 Dc 10 Rm 100 $ N
    Move L [*] ... Sm 50 Ac 10 Dc 10 Rm 100 Rnd 0 $ N
    Move R [*] J1 0 J2 0 J3 0 J4 0 J5 90 J6 0 J7 0 J8 0 J9 0 Sp 25 Ac 10 Dc 10 Rm 80 $ N
    Wait Time = .5

Rz, Ry, Rx are no angles about axes one after the other: they are x, y, z of the rotation vector in degrees. Sp is a
percentage, of the joints' speeds; Ss a time in seconds; Sm a speed of the tool in mm/s. The ramps Ac, Dc, Rm, the
rounding Rnd and the wrist's letter behind $ are not taken over: a step has its own law, ends at rest, and keeps the
arm's branch.

Source: Annin-Robotics/ar4-hmi, commit 7ddbeb1 of 2025-10-19, AR4.py: what it inserts when a position is taught (line
6950 ff), how it reads that (3361 ff), and line 674, which gives the rotation vector's u, v, w to Rz, Ry, Rx.
"""

from typing import Final

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import finite_number
from steptwin.host.planning.foreign.line import LeftOut, ReadLine, Remark, TakenOver

_OF_TOOL: Final = ("X", "Y", "Z", "Rz", "Ry", "Rx")
_OF_JOINTS: Final = ("J1", "J2", "J3", "J4", "J5", "J6")
_MOVES: Final = {"Move J": ("go", _OF_TOOL), "Move L": ("line", _OF_TOOL), "Move R": ("go", _OF_JOINTS)}
_OTHER_AXES: Final = ("J7", "J8", "J9")
_PACES: Final = {"go": {"Sp": "speed_percent", "Ss": "duration_s"}, "line": {"Sm": "speed_mm_s"}}
_WAIT: Final = "Wait Time = "


def read_line(line: str, joints: tuple[str, ...]) -> ReadLine:
    """Return what a line is; raise InputError for a number of a move that is missing or none."""
    if line.startswith("##"):
        return Remark(line.strip("# "))
    if line.startswith(_WAIT):
        return TakenOver({"pause": finite_number(line.removeprefix(_WAIT))})
    head, star, rest = line.partition(" [*] ")
    if not star or head not in _MOVES:
        return LeftOut(line, "no motion that this line alone says" if star else "no motion")
    verb, names = _MOVES[head]
    with prefixed(f"{head}: "):
        values = _values(rest.partition("$")[0])
        if missing := [name for name in names if name not in values]:
            raise InputError(f"{missing[0]} is missing")
    if moved := [name for name in _OTHER_AXES if values.get(name)]:
        return LeftOut(line, f"{moved[0]} is an axis beside the arm")
    numbers = [values[name] for name in names]
    pose = dict(zip("xyz", numbers, strict=False)) | {"rotvec_deg": numbers[3:]}
    target = dict(zip(joints, numbers, strict=True)) if names is _OF_JOINTS else pose
    pace = {key: values[name] for name, key in _PACES[verb].items() if name in values}
    said = " ".join(f"{name} {values[name]:g}" for name in ("Sp", "Ss", "Sm") if name in values)
    return TakenOver({verb: target, **pace}, "" if pace else said)


def _values(text: str) -> dict[str, float]:
    """Return the numbers of a move by the names before them."""
    words = text.split()
    if len(words) % 2:
        raise InputError(f"{words[-1]} has no number")
    values = {}
    for name, number in zip(words[::2], words[1::2], strict=True):
        with prefixed(f"{name}: "):
            values[name] = finite_number(number)
    return values
