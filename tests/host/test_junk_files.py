"""No value, key or name in a file of a user's ends in a traceback: it is refused in lines that name it, or taken."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from steptwin.host.cli.run.check import check_program
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import features
from steptwin.host.common.findings import Findings
from steptwin.host.robots import brought_text, read_robot
from tests.host.robots.coupled import coupled_text
from tests.junk import check_junk

DOCS: Final = Path(__file__).parents[2] / "docs"
EVENING: Final = re.compile(r"<!-- evening -->\n```toml\n(.*?)```", re.DOTALL)


def _campaign(text: str) -> None:
    from steptwin.features.campaigns.campaign import parse_campaign
    from steptwin.features.campaigns.sources import Sources

    parse_campaign(Sources("campaign.toml", text, folder=Path("no-such-folder")))


def _program(text: str) -> None:
    check_program(str(DOCS / "programs" / "own.toml"), text, None, Findings())


def _small() -> str:
    from tests.features.campaigns.campaigns import SMALL

    return SMALL


def _evening() -> str:
    found = EVENING.search((DOCS / "faults.md").read_text(encoding="utf-8"))
    assert found is not None
    return found[1]


KINDS: Final[dict[str, tuple[Callable[[], str], Callable[[str], object], int]]] = {
    "robot": (lambda: brought_text("warehouse-scara"), read_robot, 37),
    "coupled robot": (coupled_text, read_robot, 37),
    "program": (lambda: (DOCS / "programs/teaching-scara.toml").read_text(encoding="utf-8"), _program, 47),
}
"""Each kind of file: a valid one, who reads it, and which part of all junk is tried: one of so many."""
if "campaigns" in features():
    KINDS.update({"small campaign": (_small, _campaign, 2), "evening": (_evening, _campaign, 7)})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "sparser"),
    [
        *(pytest.param(kind, 1, id=f"all of {kind}", marks=pytest.mark.slow) for kind in KINDS),
        *(pytest.param(kind, 61, id=f"some of {kind}") for kind in KINDS if kind != "program"),  # to compile takes long
    ],
)
def test_junk_in_a_file_is_refused_in_lines_or_taken(kind: str, sparser: int) -> None:
    text, read, stride = KINDS[kind]
    check_junk(text(), read, stride * sparser)


@pytest.mark.parametrize(
    ("before", "after", "strange"),
    [
        ("[joints.th2.link]", "[joints.th22.link]", "th22"),
        ("[joints.th2.switches]", "[joints.th22.switches]", "th22"),
        ("[home]", "[joints.th9]\n[home]", "th9"),
    ],
)
def test_a_mistyped_joint_is_named_once(before: str, after: str, strange: str) -> None:
    """Its keys, which are another joint's, are not called missing."""
    with pytest.raises(InputError) as caught:
        read_robot(brought_text("teaching-scara").replace(before, after))
    named = [message for message in caught.value.messages if strange in message]
    assert named == [f"joints.{strange}: this 'teaching-scara' has no such joint: there are th1, th2, d3, th4"]
