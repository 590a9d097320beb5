"""Lines of the PAROL6's programs, as its Commander writes and reads them.

    MoveJoint(89.2, -35.0, 174.4, -1.5, -28.6, 86.0, t=4)
    MovePose(x, y, z, rx, ry, rz, v=50, a=50)
    MoveCart(-40.5, 298.5, 131.7, 6.1, -0.7, -179.3, t=2, trap)
    Delay(1)

The three angles are those of spatialmath's order 'xyz': R = Rx(third) Ry(second) Rz(first), about axes that turn along,
not roll, pitch and yaw of ROS. A time t rules; without it v and a, percentages, both together; else the joints move at
45 %. The law `trap` or `poly`, the acceleration and the mark `speed` are not taken over.

Source: PCrnjak/PAROL-commander-software, commit 295888e of 2025-08-09, GUI/files/Serial_sender_good_latest.py: patterns
at lines 605, 935, 1274; SE3.RPY(..., order='xyz') at 968 and 1312; v_value = 45 at 780.
"""

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import finite_number
from steptwin.host.planning.foreign.line import LeftOut, ReadLine, Remark, TakenOver
from steptwin.host.robots.poses.rotations import of_rotation_vector, product, rotation_vector_deg

_CALL: Final = re.compile(r"(\w+)\(([^()]*)\)")
_MOVES: Final = {"MoveJoint": "go", "MovePose": "go", "MoveCart": "line"}
_FRAME: Final = ("Begin", "End")
_WORDS: Final = ("trap", "poly", "speed")
_USUAL_PERCENT: Final = 45.0
"""Speed of a joint move that says neither a time nor v and a."""
_DECIMALS: Final = 6


def read_line(line: str, joints: tuple[str, ...]) -> ReadLine:
    """Return what a line is; raise InputError for a number of a move that is missing or none."""
    call = _CALL.fullmatch(line)
    name = call[1] if call else ""
    if call is None or name not in (*_MOVES, *_FRAME, "Delay"):
        return LeftOut(line, "no motion")
    words = [word.strip() for word in call[2].split(",")] if call[2].strip() else []
    with prefixed(f"{name}: "):
        if name in _FRAME:
            return Remark("")
        if name == "Delay":
            return TakenOver({"pause": _numbers(words, 1)[0]})
        numbers = _numbers(words, len(joints))
        target = dict(zip(joints, numbers, strict=True)) if name == "MoveJoint" else _pose(numbers)
        return _step(_MOVES[name], target, _paces(words[len(joints) :]))


def _numbers(words: list[str], count: int) -> list[float]:
    if len(words) < count:
        raise InputError(f"has {len(words)} numbers, it takes {count}")
    return [finite_number(word) for word in words[:count]]


def _paces(words: list[str]) -> dict[str, float]:
    """Return t, v and a, as far as they are given above 0."""
    paces: dict[str, float] = {}
    for word in words:
        key, equals, number = word.replace(" ", "").partition("=")
        if not equals and key in _WORDS:
            continue
        if key not in ("t", "v", "a"):
            raise InputError(f"{word!r} is none of t=, v=, a=, {', '.join(_WORDS)}")
        with prefixed(f"{key}="):
            paces[key] = finite_number(number)
    return {key: value for key, value in paces.items() if value > 0.0}


def _step(verb: str, target: Mapping[str, Any], paces: dict[str, float]) -> TakenOver:
    if verb == "line":
        return TakenOver({verb: target}, " ".join(f"{key}={value:g}" for key, value in paces.items()) or "no speed")
    if "t" in paces:
        return TakenOver({verb: target, "duration_s": paces["t"]})
    percent = paces["v"] if {"v", "a"} <= paces.keys() else _USUAL_PERCENT
    return TakenOver({verb: target, "speed_percent": percent})


def _pose(numbers: list[float]) -> dict[str, Any]:
    """Return the pose of x, y, z in mm and the three angles."""
    about_z, about_y, about_x = of_rotation_vector(np.diag(numbers[3:])[:, ::-1])
    vector = rotation_vector_deg(product(about_x, product(about_y, about_z)))
    return {**dict(zip("xyz", numbers, strict=False)), "rotvec_deg": (np.round(vector, _DECIMALS) + 0.0).tolist()}
