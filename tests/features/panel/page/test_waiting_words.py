"""What the head of the page says of a program that stands at a wait."""

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.features.panel.page.header import activity_words
from steptwin.features.panel.service.snapshots import Activity


@pytest.mark.parametrize(
    ("waits_for", "paused", "words"),
    [
        ("", False, "pick 8 %"),
        ("part_ready", False, "pick waits for part_ready"),
        ("part_ready to go off", False, "pick waits for part_ready to go off"),
        ("part_ready", True, "pick 8 %, paused"),
    ],
)
def test_a_program_that_waits(waits_for: str, paused: bool, words: str) -> None:
    assert activity_words(Activity("pick", 0.081, paused=paused, pausable=True, waits_for=waits_for)) == words
