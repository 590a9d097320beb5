"""Channels become the signals of axes: by maps or by names, inverted, without glitches."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.features.captures.capture import Capture
from steptwin.features.captures.channel_map import wired
from steptwin.features.captures.reading import read_capture
from steptwin.host.common.errors import InputError
from tests.features.captures.analyser import Probe, write_session
from tests.messages import refusing

STEP = Probe("a", 0, np.array([1e-3, 1.03e-3, 2e-3, 2.03e-3, 3e-3, 3.03e-3]))
DIR = Probe("b", 0, np.array([1.5e-3]))
ENABLE = Probe("c", 1, np.array([4e-3]))
OTHER = Probe("d", 0, np.array([]))


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    return read_capture(write_session(tmp_path / "a.sr", [STEP, DIR, ENABLE, OTHER], 1e6))


def test_an_axis_has_pulses_directions_and_enable(capture: Capture) -> None:
    (axis,), (used,) = wired(capture, ["x"], ["x=D0,b,!C"])
    assert (axis.rises_s.size, axis.falls_s.size) == (3, 3)
    assert axis.signs_at(axis.rises_s).tolist() == [-1, 1, 1]
    assert axis.enable is not None
    assert (axis.enable.name, axis.enable.level) == ("c", 0)
    assert str(used) == "x=D0,b,!C"


def test_an_inverted_channel(capture: Capture) -> None:
    """STEP rests high then: the pulse that seems to have begun before the capture is left out.

    The last one has begun, and no fall ends it before the capture's end: it is a step all the same.
    """
    (axis,), _ = wired(capture, ["x"], ["x=!a,!b"])
    assert axis.signs_at(np.array([1e-3, 3e-3])).tolist() == [1, -1]
    assert np.abs(axis.rises_s - [1.03e-3, 2.03e-3, 3.03e-3]).max() < 1e-6
    assert np.abs(axis.falls_s - [2e-3, 3e-3, capture.duration_s]).max() < 1e-6
    assert axis.rests_high


@pytest.mark.parametrize(("glitch_s", "left", "dropped"), [(0.0, 3, 0), (29e-6, 3, 0), (32e-6, 0, 3)])
def test_two_edges_that_are_too_close_are_dropped_and_counted(
    capture: Capture, glitch_s: float, left: int, dropped: int
) -> None:
    (axis,), _ = wired(capture, ["x"], ["x=a,b"], glitch_s)
    assert (axis.rises_s.size, axis.glitches) == (left, dropped)


def test_a_pulse_far_shorter_than_most_is_suspicious(tmp_path: Path) -> None:
    step = STEP._replace(times_s=np.sort(np.append(STEP.times_s, [2.5e-3, 2.502e-3])))
    capture = read_capture(write_session(tmp_path / "a.sr", [step, DIR], 1e6))
    assert [wired(capture, ["x"], ["x=a,b"], glitch_s)[0][0].suspicious for glitch_s in (0.0, 5e-6)] == [1, 0]


@pytest.mark.parametrize(
    "maps",
    [
        [],
        ["x"],
        ["x=a"],
        ["x=a,b,c,d"],
        ["z=a,b"],
        ["x=a,e", "y=c,d"],
        ["x=a,b"],
        ["x=a,b", "x=c,d", "y=c,d"],
        ["x=a,b", "y=b,c"],
    ],
    ids=str,
)
def test_a_map_that_is_wrong_is_refused(capture: Capture, maps: list[str]) -> None:
    with refusing(InputError):
        wired(capture, ["x", "y"], maps)
