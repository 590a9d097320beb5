"""Traps of URDFs, each with its sentence: what is no URDF, trees that are none, and ways from base to tip."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.features.urdf.urdf_tree import LINKS_MAX, read_urdf
from steptwin.host.common.errors import InputError
from tests.features.urdf.urdfs import joint, robot_of, urdf
from tests.messages import refused_with, refusing

ONE = joint("J1", "a", "b")
TWO = ONE + joint("J2", "b", "c")


def complaint(text: str, base: str | None = None, tip: str | None = None) -> str:
    with pytest.raises(InputError) as caught:
        read_urdf(text).way(base, tip)
    return refused_with(str(caught.value))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<!DOCTYPE robot>" + urdf(ONE), "has !DOCTYPE, which no URDF needs: it is not read, take it out"),
        (
            '<!doctype r [<!ENTITY a "b">]>' + urdf(ONE),
            "has !DOCTYPE, which no URDF needs: it is not read, take it out",
        ),
        ('<!ENTITY a "b">' + urdf(ONE), "has !ENTITY, which no URDF needs: it is not read, take it out"),
        (urdf(ONE, inside="&a;"), "is no XML: "),
        (urdf(ONE)[:-10], "is no XML: "),
        ("", "is no XML: "),
        ("<sdf/>", "is no URDF: it begins with <sdf>, a URDF with <robot>"),
        (
            urdf(ONE, inside="<xacro:arm/>"),
            "is xacro, not a URDF: run xacro first, as in: xacro robot.xacro > robot.urdf",
        ),
        (
            urdf(ONE, inside='<x:arm xmlns:x="http://www.ros.org/wiki/xacro"/>'),
            "is xacro, not a URDF: run xacro first, as in: xacro robot.xacro > robot.urdf",
        ),
        (
            urdf(joint("${p}J1", "a", "b")),
            "is xacro, not a URDF: run xacro first, as in: xacro robot.xacro > robot.urdf",
        ),
        (urdf(ONE, links="aba"), "link 'a': is there twice"),
        (urdf(ONE, '<joint type="fixed"/>'), "a joint has no name"),
        (
            urdf(ONE, joint("J" * 201, "b", "c")),
            "a joint's name: 'JJJJJJJJJJJJ...JJJJJJJJJJJJJ' has 201 characters: a name has at most 200",
        ),
        (urdf(ONE, links="ab\u200b"), "a link's name: '\\u200b' has characters that cannot be printed"),
        (urdf(ONE, joint("J1", "b", "c")), "joint 'J1': is there twice"),
        (urdf(joint("J1", "a", "z")), "joint 'J1': its child 'z' is no link of the file"),
        (urdf('<joint name="J1" type="fixed"/>'), "joint 'J1': has no parent, such as <parent link=...>"),
        (urdf(TWO, joint("J3", "d", "c")), "link 'c': is carried by joints 'J2' and 'J3'; a URDF is a tree"),
    ],
)
def test_what_is_no_urdf(text: str, message: str) -> None:
    found = complaint(text, tip="b")
    assert found.startswith(message) if message.endswith(" ") else found == message  # the rest is the parser's


def test_a_processed_file_may_still_name_xacro() -> None:
    """xacro keeps the namespace and the comments of its file."""
    text = urdf(ONE).replace("<robot ", '<!-- <xacro:arm/> --><robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    assert [each.name for each in read_urdf(text).way(None, "b")] == ["J1"]


def test_a_file_of_too_many_links() -> None:
    def text(count: int) -> str:
        return "<robot>" + "".join(f'<link name="l{i}"/>' for i in range(count)) + "</robot>"

    assert len(read_urdf(text(1000)).links) == LINKS_MAX == 1000
    with refusing(InputError):
        read_urdf(text(1001))


def test_a_file_that_is_too_long(tmp_path: Path) -> None:
    with refusing(InputError):
        robot_of(tmp_path, urdf(ONE) + " " * (1 << 20))
    text = urdf(ONE, links="ab")
    assert robot_of(tmp_path, text + " " * ((1 << 20) - len(text))).joints == ("J1",)


@pytest.mark.parametrize(
    ("text", "base", "tip", "message"),
    [
        (urdf(TWO), None, "z", "--tip: link 'z' is unknown: there are a, b, c, d, e, f, g, h, i, j"),
        (urdf(TWO), "z", "c", "--base: link 'z' is unknown: there are a, b, c, d, e, f, g, h, i, j"),
        (urdf(TWO), "c", "b", "--base c: is not on the way to 'b', which is a b"),
        (urdf(TWO), "b", "b", "--base b: is not on the way to 'b', which is a b"),
        (urdf(joint("J1", "a", "b"), joint("J2", "b", "a")), None, "b", "link 'b': carries itself; a URDF is a tree"),
        (
            urdf(TWO, joint("J3", "b", "d"), links="abcd"),
            None,
            None,
            "--tip is missing: which of the last links is the tool's? There are c, d",
        ),
        (
            urdf(TWO.replace("</joint>", '<mimic joint="J9"/></joint>'), links="abc"),
            None,
            None,
            "joint 'J1' follows 'J9' (mimic), a chain's joints have a motor each: --tip a ends before it",
        ),
    ],
)
def test_ways_that_are_none(text: str, base: str | None, tip: str | None, message: str) -> None:
    assert complaint(text, base, tip) == message


MIMIC = joint("F1", "c", "d", '<mimic joint="J2"/>')


def test_the_tip_is_the_only_leaf_that_needs_no_mimic() -> None:
    tree = read_urdf(urdf(TWO, MIMIC, joint("F2", "c", "e", kind="fixed"), links="abcde"))
    assert [each.name for each in tree.way(None, None)] == ["J1", "J2", "F2"]
    assert [each.name for each in tree.way("b", None)] == ["J2", "F2"]
    assert [each.name for each in tree.way(None, "b")] == ["J1"]
    assert complaint(urdf(TWO, MIMIC, links="abcd")).endswith("--tip c ends before it")


def test_a_leaf_to_which_nothing_moves_is_no_tool() -> None:
    """The Moveo's file has a fixed link `odom` at its base, and a gripper whose jaws mimic each other."""
    odom = joint("O", "a", "e", kind="fixed")
    assert [each.name for each in read_urdf(urdf(TWO, odom, links="abce")).way(None, None)] == ["J1", "J2"]
    assert complaint(urdf(TWO, MIMIC, odom, links="abcde")).endswith("--tip c ends before it")
    assert [each.name for each in read_urdf(urdf(odom, links="ae")).way(None, None)] == ["O"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            urdf(TWO, MIMIC),
            "joint 'F1': follows 'J2' (mimic), a chain's joints have a motor each: --tip c ends before it",
        ),
        *(
            (
                urdf(TWO, joint("V", "c", "d", kind=kind)),
                f"joint 'V': is of the type {kind!r}, a chain has revolute, continuous, prismatic and fixed joints:"
                " --base d begins behind it, --tip c ends before it",
            )
            for kind in ("floating", "planar", "spherical", "")
        ),
        (
            urdf(TWO, joint("J3", "c", "d", '<axis xyz="0 0 0"/>')),
            "joint 'J3': axis 0 0 0 is no direction; 0 0 1 is along z",
        ),
        (urdf(TWO, joint("J3", "c", "d", '<axis xyz="0 1"/>')), "joint 'J3': axis xyz: has 2 numbers, it takes 3"),
        (urdf(TWO, joint("J3", "c", "d", '<origin rpy="0 a 0"/>')), "joint 'J3': origin rpy: 'a' is not a number"),
        (
            urdf(TWO, joint("J3", "c", "d", '<origin xyz="0 nan 0"/>')),
            "joint 'J3': origin xyz: 'nan' is not a finite number up to 1e+09",
        ),
        (
            urdf(TWO, joint("J3", "c", "d", '<origin rpy="0 ${pi/2} 0"/>')),
            "joint 'J3': origin is xacro, not a URDF: run xacro first, as in: xacro robot.xacro > robot.urdf",
        ),
        (
            urdf(TWO, joint("J3", "c", "d", '<origin quat_xyzw="0 0 0.1 1"/>')),
            "joint 'J3': origin quat_xyzw: its norm is 1.00499, that of a turn is 1",
        ),
        (
            urdf(TWO, joint("J3", "c", "d", '<origin quat_xyzw="0 0 0 1" rpy="0 0 0"/>')),
            "joint 'J3': origin has rpy and quat_xyzw: a turn is one of them",
        ),
        (
            urdf(TWO, joint("J3", "c", "d", '<limit lower="1" upper="-1"/>')),
            "joint 'J3': upper limit -57.2958 deg is not above the lower, 57.2958 deg: give the machine's by"
            " --set J3.lower=VALUE --set J3.upper=VALUE",
        ),
        (
            urdf(TWO, joint("J3", "c", "d", "<limit/>", kind="prismatic")),
            "joint 'J3': upper limit 0 mm is not above the lower, 0 mm: give the machine's by"
            " --set J3.lower=VALUE --set J3.upper=VALUE",
        ),
        (urdf(joint("J1", "a", "d", kind="fixed")), "--tip: no joint moves between 'a' and 'd':"),
        (
            urdf(joint("J 1", "a", "b"), joint("J.1", "b", "d")),
            "joint 'J 1': another joint is called J_1 in a robot file",
        ),
        (urdf(joint("x", "a", "d")), "kinematics.chain.x: is the name of a coordinate of the tool; Jx is free"),
        (
            urdf(*(joint(f"J{i}", "abcefghijd"[i], "abcefghijd"[i + 1]) for i in range(9))),
            "kinematics.chain: 9 joints, a board drives 1 to 8",
        ),
        (
            urdf(*(joint(f"J{i}", "abcefgjd"[i], "abcefgjd"[i + 1]) for i in range(7))),
            "7 joints move the tool, its place and turn take 3, 5 or 6: hold 1 where they stand, as in --set held=J0",
        ),
    ],
)
def test_what_is_wrong_in_the_chain(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        robot_of(tmp_path, text, tip="d")
    path = tmp_path / "r.urdf"
    assert str(caught.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    "beside",
    [
        joint("J" * 200, "c", "d"),
        MIMIC,
        joint("V", "c", "d", kind="floating"),
        joint("V", "c", "d", '<axis xyz="0 0 0"/><origin xyz="a"/>'),
        '<link name="m"><visual><geometry><mesh filename="package://r/a.stl" scale="no"/></geometry></visual></link>',
    ],
)
def test_beside_the_chain_anything_may_be(beside: str, tmp_path: Path) -> None:
    assert robot_of(tmp_path, urdf(TWO, beside), tip="c").joints == ("J1", "J2")


@given(text=st.text() | st.text(alphabet="<>/=\"' abjointlkrx0123456789.-!&;\n"))
def test_any_text_is_read_or_refused_in_a_line(text: str) -> None:
    assert "\n" not in told(lambda: read_urdf(text))


WHOLE = urdf(TWO, MIMIC, joint("S", "d", "e", '<origin xyz="1 2 3" rpy="0 0 1.5708"/>', "prismatic"), links="abcde")


@pytest.mark.slow
@given(start=st.integers(0, len(WHOLE)), length=st.integers(0, 40), instead=st.text(max_size=8))
def test_a_file_with_any_part_of_it_replaced_is_read_or_refused_in_a_line(
    start: int, length: int, instead: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = WHOLE[:start] + instead + WHOLE[start + length :]
    assert "\n" not in told(lambda: robot_of(tmp_path_factory.mktemp("urdf"), text))


def told(read: Callable[[], object]) -> str:
    """What is said of a file: nothing if it is read."""
    try:
        read()
    except InputError as error:
        return str(error)
    return ""
