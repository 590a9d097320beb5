"""Campaigns: thousands of runs with random motions, faults and settings, drawn from seeds, and what they found."""

from steptwin.host.studies.campaign.campaign import Campaign, Sources, sources_of_file, sources_of_results
from steptwin.host.studies.campaign.campaign_report import write_report
from steptwin.host.studies.campaign.margins import Performance
from steptwin.host.studies.campaign.reader import parse_campaign, read_campaign, read_scenario_table
from steptwin.host.studies.campaign.results import Results
from steptwin.host.studies.campaign.row import Breach, Ended, Row
from steptwin.host.studies.campaign.running import perform, row_of, run_seed
from steptwin.host.studies.campaign.summary import Summary, summarised
from steptwin.host.studies.campaign.trial import Trial, draw, with_varied_file
from steptwin.host.studies.campaign.workers import cluster, run_here, run_on

__all__ = [
    "Breach",
    "Campaign",
    "Ended",
    "Performance",
    "Results",
    "Row",
    "Sources",
    "Summary",
    "Trial",
    "cluster",
    "draw",
    "parse_campaign",
    "perform",
    "read_campaign",
    "read_scenario_table",
    "row_of",
    "run_here",
    "run_on",
    "run_seed",
    "sources_of_file",
    "sources_of_results",
    "summarised",
    "with_varied_file",
    "write_report",
]
