"""Figures that the documentation promises: each stands here as a literal, with the words that promise it.

Other tests show what the program does with these figures, by the names that they have in the code. Here a figure that
changes must be changed a second time, and a third time in the words.
"""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from steptwin.controller.modes import profile_feed, ramps
from steptwin.controller.motion import kernel
from steptwin.controller.node import transmit_queue
from steptwin.controller.node import transmit_queue as outbox
from steptwin.emulator.live import live_simulation as stalls
from steptwin.emulator.live import socketcand, tcp_server
from steptwin.features.campaigns import results
from steptwin.features.faults import reaction as reaction_times
from steptwin.features.motors.turning import verdict
from steptwin.features.panel.page import guard, server
from steptwin.features.panel.page import plots_card as plot
from steptwin.features.panel.service import guards
from steptwin.host.client import lease, links, shared_node, stream, waiting, waits
from steptwin.host.client.links import socketcand_bus
from steptwin.host.common import file_limits
from steptwin.host.common import processes as slowness
from steptwin.host.operate import running
from steptwin.host.planning.motions import composer
from steptwin.host.planning.programs import paces
from steptwin.host.planning.trajectory_file import points
from steptwin.host.record import recorded_bus as reading
from steptwin.host.twin.live import live_board
from steptwin.host.verify import gates, matching, oracle
from steptwin.protocol import objects, od, pvt, timer
from steptwin.protocol.objects import TPDO_DEFAULTS

PROJECT = Path(__file__).parents[1]
MIB, GIB = 1 << 20, 1 << 30
US, MS, SECOND = 72, 72_000, 72_000_000
"""In counts of the board's timer."""


@dataclass(frozen=True)
class Promise:
    """Words in a page, and the figure in the code that keeps them."""

    page: str
    words: str
    kept: float | str
    figure: float


PROMISES = [
    # --- the panel
    Promise("docs/panel.md", "moves the machine for 250 ms after its last sign of life", guards.LEASE_S, 0.25),
    Promise("docs/panel.md", "if that state is more than a second old", guards.AGE_MAX_S, 1.0),
    Promise("docs/panel.md", "position, speed and following error of the last 20 s", plot.WINDOW_S, 20.0),
    Promise("docs/panel.md", "A browser that is gone loses its place after 20 s", server._RECONNECT_S, 20.0),
    Promise("docs/panel.md", "or a program, of at most 10 MB", guard.BODY_BYTES_MAX, 10_000_000),
    # --- who is in charge, and who is lost
    Promise("docs/protocol.md", "sends a heartbeat every 100 ms as node 0x7F", lease.PERIOD_S, 0.1),
    Promise("docs/protocol.md", "0x1016:01 = 0x7F015E, which is 350 ms", lease.WATCH_HOST, 0x7F015E),
    Promise("docs/evidence.md", "misses its host's heartbeat for 350 ms", lease.TIMEOUT_MS, 350),
    Promise("docs/protocol.md", "when it has monitored no heartbeat for 1 s", od.CHARGE_UNWATCHED_MS, 1000),
    Promise("docs/evidence.md", "TPDO1 each 100 ms", TPDO_DEFAULTS[0].event_timer_ms, 100),
    Promise("docs/live.md", "wait 0.8 s for an answer", shared_node._PATIENCE_S, 0.8),
    Promise("docs/live.md", "A node has 0.8 s to answer", shared_node._PATIENCE_S, 0.8),
    Promise("docs/live.md", "waited for only 50 ms each until one answers", shared_node._IMPATIENCE_S, 0.05),
    Promise("docs/live.md", "a server has a second to accept and greet", links.ANSWER_S, 1.0),
    Promise("docs/live.md", "when it has been silent for a second, one more", socketcand_bus.SILENCE_S, 1.0),
    Promise("docs/faults.md", "which the host notices after 1 s", waiting.SILENCE_S, 1.0),
    Promise("docs/faults.md", "within 40 ms after it hears of the fault", reaction_times.HOST_NOTICES_MS, 40.0),
    Promise("docs/protocol.md", "halted and begin no record for 5 s", stream._STALL_S, 5.0),
    # --- a served board
    Promise("docs/live.md", "wakes up to 10 ms late, the board catches up", stalls.STALL_NS, 10_000_000),
    Promise("docs/live.md", "first at 0.1 s and then each time", slowness.WORTH_TELLING_MS, 100.0),
    Promise("docs/live.md", "are written to disk twice a second", live_board.RECORD_EVERY_S, 0.5),
    Promise("docs/live.md", "the last 1000 operations on the machine", live_board.OPERATIONS_MAX, 1000),
    Promise("docs/live.md", "ends the connection when 1 MiB waits for it", tcp_server.BACKLOG_MAX_BYTES, MIB),
    Promise("docs/live.md", "tries again five times a second", tcp_server.ACCEPT_PAUSE_S, 0.2),
    Promise("docs/live.md", "the server holds back frames for 100 ms", socketcand.SILENCE_S, 0.1),
    # --- the board
    Promise("docs/evidence.md", "The queue holds 64 records", pvt.QUEUE_DEPTH, 64),
    Promise("docs/protocol.md", "a step more than 250 us late", kernel.TICK_COUNTS, 250 * US),
    Promise("docs/protocol.md", "leaves its mailboxes empty for 100 us", transmit_queue.PAUSE_COUNTS, 100 * US),
    Promise("docs/protocol.md", "If a mailbox is not free after 5 ms", transmit_queue.PAUSE_COUNTS_MAX, 5 * MS),
    Promise("docs/protocol.md", "until a second has passed without a loss", outbox.QUIET_US, 1_000_000),
    Promise("docs/protocol.md", "two minutes at power-up", objects.ENTRIES[od.HOMING_TIMEOUT_MS].default, 120_000),
    Promise("docs/evidence.md", "segments of 8 to 16 ms", ramps.GRAIN_MS, 8),
    Promise("docs/evidence.md", "segments of 8 to 16 ms", ramps.PIECE_MS, 16),
    Promise("docs/evidence.md", "keeps some 50 ms of them queued", profile_feed.AHEAD_MS, 48),
    Promise("docs/run-folder.md", "72 000 000", timer.COUNTS_PER_SECOND, SECOND),
    # --- the verdict
    Promise("README.md", "which steps at 9/16 of a step", oracle.THRESHOLD_STEPS, 9 / 16),
    Promise("README.md", "fails above 0.57 at 1/16", gates.POSITION_ERROR_LIMIT_STEPS, 0.57),
    Promise("docs/live.md", "more than 9/16 step, the firmware's hysteresis", running.END_ERROR_STEPS_MAX, 9 / 16),
    Promise("docs/evidence.md", "without crossings slower than 1 % of the axis' fastest", matching.SLOW_CROSSING, 0.01),
    Promise("docs/motors.md", "1 - needs / has; a warning below 30 %", verdict.MARGIN_MIN, 0.30),
    # --- motions and files
    Promise("docs/programs.md", "stands still for 0.3 s", composer.SWITCHING_S, 0.3),
    Promise("docs/programs.md", "in `ramp_s`, 0.3 s by default", paces.RAMP_S, 0.3),
    Promise("docs/programs.md", "A wait is counted as 0.01 s in the plan", composer.WAIT_S, 0.01),
    Promise("docs/programs.md", "The motion goes on 0.25 to 0.3 s after the input", waits.LEAD_MS, 250),
    Promise("docs/programs.md", "# up to an hour", composer.WAIT_MAX_S, 3600.0),
    Promise("docs/motions.md", "A motion lasts an hour at most", points.LONGEST_S, 3600.0),
    Promise("docs/motions.md", "up to 3 600 001 points", file_limits.POINTS_MAX, 3_600_001),
    Promise("docs/motions.md", "a JSON file up to 64 MiB", file_limits.JSON_BYTES_MAX, 64 * MIB),
    Promise("docs/run-folder.md", "more than 16 GiB of arrays", file_limits.ARRAYS_BYTES_MAX, 16 * GIB),
    Promise("docs/run-folder.md", "100 times the size of the file", file_limits.ARRAYS_RATIO_MAX, 100),
    Promise("docs/run-folder.md", "3 600 001 points or 3 GiB", file_limits.CSV_BYTES_MAX, 3 * GIB),
    Promise("docs/run-folder.md", "a `report.json` of more than 16 MiB", file_limits.REPORT_BYTES_MAX, 16 * MIB),
    Promise("docs/run-folder.md", "a `robot.toml` of more than 256 KiB", file_limits.ROBOT_BYTES_MAX, 256 << 10),
    Promise("docs/shadow.md", "of more than 2 GiB", file_limits.RECORDED_BYTES_MAX, 2 * GIB),
    Promise("docs/shadow.md", "of more than 5 000 000 frames", file_limits.RECORDED_FRAMES_MAX, 5_000_000),
    Promise("docs/shadow.md", "more than a day by its time stamps", reading._LASTS_S_MAX, 86_400),
    Promise("docs/faults.md", "every 1 000 runs or 30 s", results.PART_ROWS, 1000),
    Promise("docs/faults.md", "every 1 000 runs or 30 s", results.PART_S, 30.0),
]


@cache
def words_of(page: str) -> str:
    return " ".join((PROJECT / page).read_text(encoding="utf-8").split())


@pytest.mark.parametrize("promise", PROMISES, ids=lambda promise: promise.words)
def test_a_promised_figure_is_kept(promise: Promise) -> None:
    assert promise.words in words_of(promise.page)
    assert promise.kept == pytest.approx(promise.figure, rel=1e-12)


def in_the_browser(name: str) -> float:
    """Return a constant of the page's own script."""
    script = (PROJECT / "features/panel/page/static/panel.js").read_text(encoding="utf-8")
    found = re.findall(rf"^ *const {name} = (\d+);", script, re.MULTILINE)
    assert len(found) == 1
    return int(found[0])


def test_a_held_button_may_lose_two_beats() -> None:
    """The page beats every 80 ms, as the server expects: the third beat comes 240 ms after the last, within 250."""
    assert in_the_browser("BEAT_MS") == 80
    assert guards.BEAT_S == 0.08


def test_a_stop_that_nothing_answers_is_said_within_300_ms() -> None:
    """And it is sent again every 250 ms until it is answered."""
    assert "If nothing answers within 300 ms it says in red that the button does not work" in words_of("docs/panel.md")
    assert (in_the_browser("UNANSWERED_MS"), in_the_browser("AGAIN_MS")) == (300, 250)


def test_the_page_turns_grey_within_half_a_second() -> None:
    """It looks every 100 ms whether the last tick is more than 400 ms old."""
    assert "the page turns grey within half a second" in words_of("docs/panel.md")
    assert (in_the_browser("SILENT_MS"), in_the_browser("LOOK_MS")) == (400, 100)
