"""The player of a replay: speeds, ends, steps to edges and marks."""

import numpy as np
import pytest

from steptwin.features.view.marks import MarkKind, RunMark
from steptwin.features.view.model import Replay
from steptwin.features.view.page import SPEEDS, Player
from tests.host.record.machines import perfect_run
from tests.host.verify.motions import ENABLE_COUNTS, START_COUNTS

RUN = perfect_run("teaching-scara", "carry")
MARKS = [RunMark(MarkKind.OUTPUT, START_COUNTS + at, START_COUNTS + at, "lamp", "on") for at in (-7200, 7200, 720_000)]


@pytest.fixture
def player() -> Player:
    return Player([Replay(RUN, MARKS)])


@pytest.mark.parametrize("speed", SPEEDS)
def test_it_plays_at_each_speed(player: Player, speed: float) -> None:
    player.speed = speed
    assert not player.advance(1.0)
    player.play()
    assert player.advance(0.004)
    assert player.t_s == pytest.approx(0.004 * speed)


def test_it_stands_at_the_end_and_plays_again_from_the_start(player: Player) -> None:
    player.play()
    assert player.advance(100.0)
    assert (player.t_s, player.playing) == (player.last_s, False)
    assert player.last_s >= 1.0
    player.play()
    assert (player.t_s, player.playing) == (0.0, True)


def test_it_is_sought_within_what_is_shown(player: Player) -> None:
    player.play()
    player.seek(-5.0)
    assert player.t_s == player.first_s == -START_COUNTS / 72e6
    assert not player.playing
    player.seek(5.0)
    assert player.t_s == player.last_s


def test_steps_go_from_edge_to_edge_both_ways(player: Player) -> None:
    axis = RUN.comparison.evidence.axes[0]
    counts = np.sort(np.concatenate([axis.clk_rise_counts, axis.clk_fall_counts, axis.dir_edge_counts]))
    player.play()
    forwards = []
    for _ in range(7):
        edge = player.step(1, axis="th1")
        assert edge is not None
        assert player.t_s == (edge.counts - START_COUNTS) / 72e6
        forwards.append(edge.counts)
    assert forwards == counts[counts > START_COUNTS][:7].tolist()
    assert not player.playing
    backwards = [player.step(-1, axis="th1") for _ in range(6)]
    assert [edge.counts for edge in backwards if edge] == forwards[-2::-1]


def test_there_is_no_step_beyond_the_record(player: Player) -> None:
    player.seek(player.last_s)
    assert player.step(1) is None
    assert player.t_s == player.last_s
    player.seek(player.first_s)
    first = player.step(1)
    assert first is not None
    assert first.counts == ENABLE_COUNTS


def test_steps_to_marks(player: Player) -> None:
    seen = []
    for way in (1, 1, 1, -1, -1, -1):
        player.step_to_mark(way)
        seen.append(round(player.t_s * 72e6))
    assert seen == [7200, 720_000, 720_000, 7200, -7200, -7200]
