"""What the page's server tells of: its own faults, and not those of a client that it has closed out."""

import logging
import sys

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.features.panel.page.server import is_own_fault


def record(error: Exception) -> logging.LogRecord:
    try:
        raise error
    except Exception:
        return logging.LogRecord("uvicorn.error", logging.ERROR, "", 0, "", None, sys.exc_info())


def test_a_frame_that_is_no_utf_8_is_not_told() -> None:
    assert not is_own_fault(record(UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")))
    assert is_own_fault(record(ValueError()))
    assert is_own_fault(logging.LogRecord("uvicorn.error", logging.ERROR, "", 0, "said", None, None))
