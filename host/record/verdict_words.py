"""Verdict of a run as text, for the command line and pictures."""

from collections.abc import Mapping
from typing import Any


def verdict_words(document: Mapping[str, Any]) -> list[str]:
    """Return the verdict of a report, with the reasons if it is not PASSED."""
    if "fault" in document:
        if not document["fault"].get("timed_out"):
            return ["STOPPED BY A FAULT"]
        reasons = document["reasons"] or ["up to the wait every pulse is right"]
        return ["STOPPED BY A WAIT THAT TIMED OUT", *reasons]
    if document.get("passed") is None:
        return ["NOT VERIFIED", "a live board does not know its plan: `steptwin verify` compares it with one"]
    if document["reasons"] == [document.get("interruption")]:
        return ["INCOMPLETE", *document["reasons"]]
    if document["passed"]:
        return ["PASSED"]
    stopped_alone = "stopped" in document and len(document["reasons"]) == 1
    return ["STOPPED" if stopped_alone else "FAILED", *document["reasons"]]
