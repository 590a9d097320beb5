"""Read the tree of a URDF, its links and the joints between them: plain XML of ROS, version 1.0 to 1.2.

A document type is rejected before parsing, since a URDF has none and entities could grow without end. Numbers of a
joint are read on use: joints outside the chain from base to tip may be of any kind.

Source: https://wiki.ros.org/urdf/XML/joint; `quat_xyzw` of version 1.1: the README of ros/urdfdom.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np

from steptwin.host.common.bad_input import prefixed, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import finite_number
from steptwin.host.common.tables import check_name

_XACRO: Final = "is xacro, not a URDF: run xacro first, as in: xacro robot.xacro > robot.urdf"
_XACRO_NAMES: Final = ("property", "arg", "macro")
"""Elements of xacro that only define names. `${`, `$(` or an element with such a name shows a use."""
_MM_PER_M: Final = 1000.0
_NORM_OFF: Final = 1e-3
"""Largest deviation of a quaternion's norm from 1, from the rounding of its four numbers."""
_AXIS_LEAST: Final = 1e-6
"""Least length of an axis, as in robot files."""

NAME_CHARS_MAX: Final = 200
"""Longest name of a link or joint in messages; those of the largest robots have some 60 characters."""
LINKS_MAX: Final = 1000
"""Largest number of links; a robot with two arms, hands and all its sensors has some 200."""
MOVING: Final = ("revolute", "continuous", "prismatic")
FIXED: Final = "fixed"

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class UrdfJoint:
    """A joint of a URDF between two links; reading an invalid number raises InputError with the joint's name.

    Attributes:
        name: its name.
        kind: its type, such as `revolute`.
        parent: link that carries it.
        child: link that it moves.
        mimics: name of the joint that it follows; empty for an independent joint.
        element: XML element of the file.
    """

    name: str
    kind: str
    parent: str
    child: str
    mimics: str
    element: Element

    @property
    def slides(self) -> bool:
        """True for a prismatic joint: its limits are in m, those of other joints in rad."""
        return self.kind == "prismatic"

    @property
    def xyz_mm(self) -> Triple:
        """Origin in the parent's frame; 0 0 0 if missing."""
        x, y, z = self._triple("origin", "xyz", (0.0, 0.0, 0.0))
        return x * _MM_PER_M, y * _MM_PER_M, z * _MM_PER_M

    @property
    def rpy_rad(self) -> Triple:
        """Roll, pitch and yaw of the origin about fixed axes; 0 0 0 if missing."""
        return self._triple("origin", "rpy", (0.0, 0.0, 0.0))

    @property
    def quaternion_xyzw(self) -> tuple[float, ...] | None:
        """Rotation of the origin as a unit quaternion, which URDF 1.1 allows in place of rpy."""
        origin = _child(self.element, "origin")
        if origin is None or "quat_xyzw" not in origin.attrib:
            return None
        with prefixed(f"joint {self.name!r}: origin "):
            if "rpy" in origin.attrib:
                raise InputError("has rpy and quat_xyzw: a turn is one of them")
            values = np.array(_numbers("quat_xyzw", origin.attrib["quat_xyzw"], 4))
            norm = float(np.linalg.norm(values))
            if not abs(norm - 1.0) <= _NORM_OFF:
                raise InputError(f"quat_xyzw: its norm is {norm:.6g}, that of a turn is 1")
        return tuple((values / norm).tolist())

    @property
    def axis(self) -> Triple:
        """Axis in the joint's frame, of any length but 0; 1 0 0 if missing."""
        axis = self._triple("axis", "xyz", (1.0, 0.0, 0.0))
        if not float(np.linalg.norm(axis)) >= _AXIS_LEAST:
            raise InputError(f"joint {self.name!r}: axis 0 0 0 is no direction; 0 0 1 is along z")
        return axis

    def limit(self, key: str) -> float | None:
        """Return a number of the joint's limit in m or rad: lower, upper, velocity or effort; None if missing."""
        element = _child(self.element, "limit")
        if element is None or key not in element.attrib:
            return None
        with prefixed(f"joint {self.name!r}: limit "):
            return _numbers(key, element.attrib[key], 1)[0]

    def _triple(self, tag: str, key: str, missing: Triple) -> Triple:
        element = _child(self.element, tag)
        if element is None or key not in element.attrib:
            return missing
        with prefixed(f"joint {self.name!r}: {tag} "):
            x, y, z = _numbers(key, element.attrib[key], 3)
        return x, y, z


@dataclass(frozen=True, slots=True, eq=False)
class UrdfTree:
    """The links of a URDF, and the joint that carries each link, by the link's name."""

    links: tuple[str, ...]
    carrying: dict[str, UrdfJoint]

    def way(self, base: str | None, tip: str | None) -> tuple[UrdfJoint, ...]:
        """Return the joints between two links, by default from the root to the only leaf that needs no mimic.

        Raises:
            InputError: a link does not exist, no path joins the two, or there is more than one leaf.
        """
        for option, link in (("--base", base), ("--tip", tip)):
            if link is not None and link not in self.links:
                raise unknown(f"{option}: link", link, self.links)
        tip = self._only_tip(base) if tip is None else tip
        way = self._up(tip, base)
        if base is not None and (not way or way[-1].parent != base):
            links = " ".join([*reversed([joint.parent for joint in self._up(tip)]), tip])
            raise InputError(f"--base {base}: is not on the way to {tip!r}, which is {links}")
        return tuple(reversed(way))

    def _only_tip(self, base: str | None) -> str:
        parents = {joint.parent for joint in self.carrying.values()}
        leaves = [link for link in self.links if link not in parents]
        if base is not None:
            leaves = [link for link in leaves if any(joint.parent == base for joint in self._up(link))]
        ways = {link: self._up(link, base) for link in leaves}
        leaves = [link for link, way in ways.items() if any(joint.kind in MOVING for joint in way)] or leaves
        free = [link for link in leaves if not any(joint.mimics for joint in ways[link])]
        if len(free) == 1:
            return free[0]
        if leaves and not free:
            raise InputError(_all_mimic([ways[link] for link in leaves]))
        named = ", ".join(map(shortened, free)) or "none"
        raise InputError(f"--tip is missing: which of the last links is the tool's? There are {named}")

    def _up(self, link: str, base: str | None = None) -> list[UrdfJoint]:
        """Return the joints from a link up to the base or the root."""
        found: list[UrdfJoint] = []
        passed = {link}
        while link != base and link in self.carrying:
            found.append(self.carrying[link])
            link = found[-1].parent
            if link in passed:
                raise InputError(f"link {link!r}: carries itself; a URDF is a tree")
            passed.add(link)
        return found


def _all_mimic(ways: Sequence[Sequence[UrdfJoint]]) -> str:
    """Return whether every path has a mimic joint, each from its last link on, and where each can end."""
    first = [next(joint for joint in reversed(way) if joint.mimics) for way in ways]
    followers = ", ".join(dict.fromkeys(f"{joint.name!r} follows {joint.mimics!r}" for joint in first))
    ends = " or ".join(dict.fromkeys(f"--tip {joint.parent}" for joint in first))
    return f"joint {followers} (mimic), a chain's joints have a motor each: {ends} ends before it"


def read_urdf(text: str) -> UrdfTree:
    """Return the tree of a URDF; raise InputError for another text."""
    lower = text.lower()
    for mark in ("<!doctype", "<!entity"):
        if mark in lower:
            raise InputError(f"has {mark[1:].upper()}, which no URDF needs: it is not read, take it out")
    try:
        root = fromstring(text)
    except ParseError as error:
        _refuse_xacro("<xacro:" in lower)
        raise InputError(f"is no XML: {error}") from None
    _refuse_xacro(_makes_more(root))
    if _tag(root) != "robot":
        raise InputError(f"is no URDF: it begins with <{shortened(_tag(root))}>, a URDF with <robot>")
    links = tuple(_name(each, "link") for each in _children(root, "link"))
    if len(links) > LINKS_MAX:
        raise InputError(f"has {len(links)} links: at most {LINKS_MAX} are read")
    if twice := [link for link, count in Counter(links).items() if count > 1]:
        raise InputError(f"link {twice[0]!r}: is there twice")
    return UrdfTree(links, _carrying(root, set(links)))


def _carrying(root: Element, links: set[str]) -> dict[str, UrdfJoint]:
    carrying: dict[str, UrdfJoint] = {}
    names: set[str] = set()
    for element in _children(root, "joint"):
        joint = _joint(element)
        if joint.name in names:
            raise InputError(f"joint {joint.name!r}: is there twice")
        names.add(joint.name)
        for key, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise InputError(f"joint {joint.name!r}: its {key} {shortened(link)!r} is no link of the file")
        if joint.child in carrying:
            both = f"{carrying[joint.child].name!r} and {joint.name!r}"
            raise InputError(f"link {joint.child!r}: is carried by joints {both}; a URDF is a tree")
        carrying[joint.child] = joint
    return carrying


def _joint(element: Element) -> UrdfJoint:
    name = _name(element, "joint")
    ends = {}
    for key in ("parent", "child"):
        end = _child(element, key)
        if end is None or "link" not in end.attrib:
            raise InputError(f"joint {name!r}: has no {key}, such as <{key} link=...>")
        ends[key] = end.attrib["link"]
        _refuse_used(ends[key])
    mimic = _child(element, "mimic")
    mimics = "" if mimic is None else shortened(mimic.get("joint", "another"))
    _refuse_used(element.get("type", ""))
    return UrdfJoint(name, shortened(element.get("type", "")), ends["parent"], ends["child"], mimics, element)


def _name(element: Element, what: str) -> str:
    name = element.get("name", "")
    _refuse_used(name)
    if not name:
        raise InputError(f"a {what} has no name")
    with prefixed(f"a {what}'s name: "):
        check_name(name, NAME_CHARS_MAX)
    return name


def _numbers(key: str, text: str, count: int) -> list[float]:
    _refuse_used(text)
    words = text.split()
    if len(words) != count:
        raise InputError(f"{key}: has {len(words)} numbers, it takes {count}")
    with prefixed(f"{key}: "):
        return [finite_number(word) for word in words]


def _makes_more(root: Element) -> bool:
    """Return whether xacro would create elements here; unused definitions do not count."""
    left = [root]
    while left:
        element = left.pop()
        namespace, _, tag = element.tag.rpartition("}")
        if not namespace.endswith("/xacro"):
            left += element
        elif tag not in _XACRO_NAMES:
            return True
    return False


def _refuse_used(text: str) -> None:
    """Raise InputError for a text in which xacro would insert a value."""
    _refuse_xacro("${" in text or "$(" in text)


def _refuse_xacro(found: bool) -> None:
    if found:
        raise InputError(_XACRO)


def _tag(element: Element) -> str:
    """Return an element's tag without its namespace."""
    return element.tag.rpartition("}")[2]


def _children(element: Element, tag: str) -> Iterator[Element]:
    return (each for each in element if _tag(each) == tag)


def _child(element: Element, tag: str) -> Element | None:
    return next(_children(element, tag), None)
