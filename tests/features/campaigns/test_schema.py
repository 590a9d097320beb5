"""`steptwin schema campaign`: it accepts the campaigns that come along, refuses wrong ones and describes each key."""

import tomllib
from typing import Final

import pytest

from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.sources import NIGHTLY, sources_of_file
from steptwin.host.common.file_models import json_schema
from tests.end_to_end.pages import ROOT
from tests.features.campaigns.campaigns import SMALL
from tests.features.campaigns.test_docs import PAGE
from tests.features.campaigns.test_drawing import WIDE
from tests.host.robots.test_schema import keys_in, misfits

SCHEMA: Final = json_schema(Campaign)
CAMPAIGNS: Final = {
    "small": SMALL,
    "wide": WIDE,
    "page": PAGE.partition("<!-- evening -->\n```toml\n")[2].partition("```")[0],
    "python": (ROOT / "docs" / "examples" / "python" / "evening.toml").read_text(encoding="utf-8"),
    NIGHTLY: sources_of_file(NIGHTLY).text,
}


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_it_accepts_the_campaigns_that_come_along(name: str) -> None:
    assert misfits(tomllib.loads(CAMPAIGNS[name]), SCHEMA) == []


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("runs = 6", "runs = 0", ".runs: 0 is beyond its limits"),
        ("runs = 6", "run = 6", ".run: is unknown"),
        ("recover = false", "recover = 0", ".recover: 0 is no boolean"),
        ('name = "nothing"', 'nam = "nothing"', ".scenario[1].nam: is unknown"),
        ("reach =", "reech =", ".motion[0].reech: is unknown"),
    ],
)
def test_it_refuses_what_the_reader_refuses(old: str, new: str, place: str) -> None:
    assert old in SMALL
    assert place in misfits(tomllib.loads(SMALL.replace(old, new, 1)), SCHEMA)


def test_every_key_is_described() -> None:
    assert [place for place, each in keys_in(SCHEMA) if not each.get("description")] == []
