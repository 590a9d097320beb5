"""The words for the levels of digital inputs, outputs and buttons."""

from typing import Final

LEVELS: Final = {"on": True, "off": False}
"""Levels by their words."""
