"""What xacro leaves in a URDF without being used there, and joints that all follow others."""

import pytest

from steptwin.features.urdf.urdf_chain import chain_of
from steptwin.features.urdf.urdf_tree import read_urdf
from steptwin.host.common.errors import InputError

JOINT = (
    '<joint name="{0}" type="{3}"><parent link="{1}"/><child link="{2}"/>'
    '<limit lower="-1" upper="1" velocity="1"/>{4}</joint>'
)


def urdf(*parts: str, links: str = "abcd") -> str:
    bodies = "".join(f'<link name="{name}"/>' for name in links)
    return f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{"".join(parts)}{bodies}</robot>'


def joint(name: str, parent: str, child: str, more: str = "", kind: str = "revolute") -> str:
    return JOINT.format(name, parent, child, kind, more)


CHAIN = (joint("j1", "a", "b"), joint("j2", "b", "c"), joint("j3", "c", "d"))


@pytest.mark.parametrize(
    "unused",
    [
        '<xacro:property name="width" value="0.2"/>',
        '<xacro:arg name="prefix" default=""/>',
        '<xacro:macro name="leg" params="side"><link name="${side}"/><xacro:foot/></xacro:macro>',
    ],
)
def test_a_name_that_nothing_uses_changes_nothing(unused: str) -> None:
    assert read_urdf(urdf(unused, *CHAIN)).links == read_urdf(urdf(*CHAIN)).links


@pytest.mark.parametrize(
    "used",
    [
        '<xacro:include filename="x.xacro"/>',
        '<xacro:leg side="l"/>',
        '<xacro:if value="1"/>',
        "<link name='l'><xacro:inertia/></link>",
        joint("$(arg p)j", "d", "e"),
        joint("j", "${p}d", "e"),
        joint("j", "d", "e", kind="${kind}"),
    ],
)
def test_what_is_used_needs_xacro(used: str) -> None:
    with pytest.raises(InputError, match="is xacro, not a URDF: run xacro first"):
        read_urdf(urdf('<xacro:property name="p" value="0.2"/>', *CHAIN, used, links="abcde"))


MIMIC = '<mimic joint="j1"/>'


def test_a_chain_behind_a_joint_that_follows_another_says_where_it_can_end() -> None:
    tree = read_urdf(urdf(joint("j1", "a", "b"), joint("j2", "b", "c", MIMIC), joint("j3", "c", "d")))
    told = "joint 'j2' follows 'j1' (mimic), a chain's joints have a motor each: --tip b ends before it"
    with pytest.raises(InputError) as caught:
        chain_of(tree, None, None, snap=False)
    assert str(caught.value) == told
    assert [move.name for move in chain_of(tree, None, "b", snap=False).moves] == ["j1"]


def test_so_do_two_fingers_that_both_follow() -> None:
    tree = read_urdf(urdf(joint("j1", "a", "b"), joint("j2", "b", "c", MIMIC), joint("j3", "b", "d", MIMIC)))
    with pytest.raises(InputError, match=r"'j2' follows 'j1', 'j3' follows 'j1' \(mimic\).*: --tip b ends before it"):
        chain_of(tree, None, None, snap=False)


def test_one_of_two_tips_is_still_asked_for() -> None:
    tree = read_urdf(urdf(joint("j1", "a", "b"), joint("j2", "b", "c"), joint("j3", "b", "d")))
    with pytest.raises(InputError, match="--tip is missing: which of the last links is the tool's"):
        chain_of(tree, None, None, snap=False)
