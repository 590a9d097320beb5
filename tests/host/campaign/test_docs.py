"""The example of docs/campaigns.md, run small, and what the page says of keys, invariants and columns."""

import re
from pathlib import Path

import pytest

from steptwin.host.campaign import Campaign, Ended, draw, read_campaign, run_seed, sources_of_file
from steptwin.host.campaign.invariants import INVARIANTS
from steptwin.host.campaign.results import schema
from steptwin.host.campaign.values import read_template
from steptwin.host.campaign.variations import VARIATIONS
from steptwin.host.common.errors import InputError
from tests.host.campaign.campaigns import campaign_of

PAGE = (Path(__file__).parents[3] / "docs" / "campaigns.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def evening(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    text = PAGE.partition("<!-- evening -->\n```toml\n")[2].partition("```")[0]
    return campaign_of(text.replace("runs = 1000", "runs = 1000\nrecover = false"), tmp_path_factory.mktemp("page"))


def test_the_evening_runs(evening: Campaign) -> None:
    """One run of each scenario, of the shortest motions among the first."""
    trials = {}
    for trial in sorted((draw(evening, seed) for seed in range(40)), key=lambda trial: -trial.trajectory.duration_s):
        trials[trial.scenario] = trial
    assert len(trials) == len(evening.scenarios) == 4
    for trial in trials.values():
        row = run_seed(evening, trial.seed)
        assert row.ended in (Ended.DONE, Ended.STOPPED)
        assert (row.breaches, all(row.struck)) == ((), True), row


def test_the_nightly_campaign_is_read() -> None:
    campaign, files = read_campaign(sources_of_file("nightly"))
    assert (campaign.runs, files) == (10_000, set())
    assert len(campaign.robots) == 5
    for seed in range(40):
        trial = draw(campaign, seed)
        trial.scenario_in(trial.plan())


def test_every_invariant_parameter_and_column_is_on_the_page() -> None:
    table = PAGE.partition("## What must hold")[2].partition("## The report")[0]
    assert re.findall(r"^\| (\w+) \|", table, flags=re.MULTILINE)[1:] == list(INVARIANTS)
    columns = PAGE.partition("| column | is |")[2]
    for name in schema().names:
        assert f"`{name}`" in columns, name
    for name in VARIATIONS:
        assert f"`{name}`" in PAGE, name


def test_every_draw_is_on_the_page() -> None:
    table = PAGE.partition("| drawn value | is |")[2].partition("\n\n")[0]
    kinds = re.findall(r"\{ (\w+) = ", table)
    assert len(kinds) == 7
    for kind in kinds:
        with pytest.raises(InputError, match=f"^{kind}: |^any: "):
            read_template({kind: "nonsense"})
