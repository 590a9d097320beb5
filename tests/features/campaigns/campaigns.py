"""Campaigns for tests: short motions, few runs."""

from pathlib import Path
from typing import Final

from steptwin.features.campaigns.campaign import Campaign, read_campaign
from steptwin.features.campaigns.sources import sources_of_file

SMALL: Final = """
runs = 6
robots = ["teaching-scara"]
recover = false

[[motion]]
moves = 1
reach = { uniform = [0.02, 0.05] }

[[scenario]]
name = "emergency stop"
[[scenario.fault]]
do = "estop"
pressed = true
at_s = { part_of_motion = [0.1, 0.9] }

[[scenario]]
name = "nothing"

[vary]
record_ms = { choose = [5, 10] }
"""


def campaign_of(text: str, folder: Path) -> Campaign:
    """Return the campaign of a text."""
    file = folder / "campaign.toml"
    file.write_text(text, encoding="utf-8")
    campaign, _ = read_campaign(sources_of_file(str(file)))
    return campaign
