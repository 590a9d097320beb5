"""Judge captures of a run whose edges are known: what passes, what is counted, and what is named."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.captures.each_driver import by_each_driver
from steptwin.features.captures.judging import CapturedRun, CaptureJudge, judge_alone, judge_capture
from steptwin.features.captures.limits_read import Kept
from steptwin.features.captures.reading import read_capture
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.features.captures.analyser import Probe, probes_of, seen_by, write_session
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
PLAN = plan(ROBOT, make_job(ROBOT, "carry", {}))
MAPS = ["th1=D0,D1", "th2=D2,D3", "d3=D4,D5", "th4=D6,D7"]
BEFORE_S = 0.0123456789
PPM = 50.0
TH2_STEP, TH2_DIR = 2, 3
Damage = Callable[[list[Probe]], list[Probe]]


@pytest.fixture(scope="module")
def evidence(fast_kernel: Kernel) -> Evidence:
    return execute(PLAN, "carry", fast_kernel).comparison.evidence


@cache
def truth_s(start_counts: int) -> float:
    """When the plan's t = 0 is in the capture."""
    return start_counts / COUNTS_PER_SECOND * (1.0 + PPM * 1e-6) + BEFORE_S


def judged(
    probes: list[Probe], path: Path, rate_hz: float = 8e6, judge: CaptureJudge | None = None, ppm: float = PPM
) -> CapturedRun:
    write_session(path / "a.sr", seen_by(probes, ppm, BEFORE_S), rate_hz)
    judge = judge or CaptureJudge(maps=MAPS)
    return judge_capture(read_capture(path / "a.sr"), ROBOT, "carry", PLAN.motion, judge)


def changed(probes: list[Probe], index: int, times_s: FloatArray) -> list[Probe]:
    return [probe._replace(times_s=times_s) if i == index else probe for i, probe in enumerate(probes)]


# --- what was planned


@pytest.mark.parametrize(("rate_hz", "ppm_within", "offset_us"), [(24e6, 0.2, 0.1), (8e6, 0.2, 0.1), (1e6, 0.2, 0.1)])
def test_our_own_edges_pass_and_the_clock_is_found(
    evidence: Evidence, rate_hz: float, ppm_within: float, offset_us: float, tmp_path: Path
) -> None:
    """The firmware is late by 0.08 us on average, which the offset takes up."""
    run = judged(probes_of(evidence), tmp_path, rate_hz)
    assert (run.passed, run.reasons, run.hints) == (True, (), ())
    assert run.clock.ppm == pytest.approx(PPM, abs=ppm_within)
    assert run.clock.offset_s - truth_s(evidence.start_counts) == pytest.approx(0.0, abs=offset_us * 1e-6)
    assert {answer.kept for answer in run.seen.limits} == {Kept.KEPT}
    assert run.assumed[-4:] == ("th1.ENABLE", "th2.ENABLE", "d3.ENABLE", "th4.ENABLE")


def test_at_200_khz_it_cannot_tell_whether_pulses_were_long_enough_and_passes(
    evidence: Evidence, tmp_path: Path
) -> None:
    run = judged(probes_of(evidence), tmp_path, 2e5)
    assert run.passed
    told = {(answer.axis, answer.limit.rule): answer.kept for answer in run.seen.limits}
    assert told["th2", "clk_high"] is Kept.UNKNOWN
    assert run.hints == ("at 200000 Hz it cannot be told whether clk_high was kept: sample faster",)


@pytest.mark.parametrize("grid_us", [25, 40])
def test_a_controller_on_a_timers_grid_passes(evidence: Evidence, grid_us: int, tmp_path: Path) -> None:
    probes = [
        probe if i % 2 else probe._replace(times_s=_on_grid(probe.times_s, grid_us * 1e-6))
        for i, probe in enumerate(probes_of(evidence))
    ]
    assert judged(probes, tmp_path).reasons == ()


def _on_grid(times_s: FloatArray, grid_s: float) -> FloatArray:
    rises = np.ceil(times_s[0::2] / grid_s) * grid_s
    return np.column_stack([rises, rises + 33e-6]).ravel()


# --- what was not


@pytest.mark.parametrize("rate_hz", [8e6, 1e6])
@pytest.mark.parametrize("count", [1, 3, 40])
def test_lost_pulses_are_counted(evidence: Evidence, count: int, rate_hz: float, tmp_path: Path) -> None:
    probes = probes_of(evidence)
    left = np.delete(probes[TH2_STEP].times_s, slice(1000, 1000 + 2 * count))
    run = judged(changed(probes, TH2_STEP, left), tmp_path, rate_hz)
    assert [axis.unmatched_steps for axis in run.report.axes] == [0, count, 0, 0]
    assert run.clock.ppm == pytest.approx(PPM, abs=0.2)
    first_s = run.comparison.ideal[1].time_s[500]
    assert f"th2: unmatched steps {count} (limit 0), the first at {first_s:.3f} s" in run.reasons


def test_where_every_axis_has_lost_pulses_the_clock_is_found_all_the_same(evidence: Evidence, tmp_path: Path) -> None:
    lossy = [
        probe if i % 2 else probe._replace(times_s=np.delete(probe.times_s, slice(400, 406)))
        for i, probe in enumerate(probes_of(evidence))
    ]
    run = judged(lossy, tmp_path)
    assert [axis.unmatched_steps for axis in run.report.axes] == [3, 3, 0, 3]
    assert run.clock.ppm == pytest.approx(PPM, abs=0.3)


@pytest.mark.parametrize("count", [1, 3, 40])
def test_extra_pulses_are_counted(evidence: Evidence, count: int, tmp_path: Path) -> None:
    probes = probes_of(evidence)
    times_s = probes[TH2_STEP].times_s
    between = (times_s[1001 : 1001 + 2 * count : 2] + times_s[1002 : 1002 + 2 * count : 2]) / 2
    more = np.sort(np.concatenate([times_s, between - 16e-6, between + 17e-6]))
    run = judged(changed(probes, TH2_STEP, more), tmp_path)
    assert [axis.unmatched_steps for axis in run.report.axes] == [0, count, 0, 0]
    assert not run.passed


def test_an_inverted_dir_is_named(evidence: Evidence, tmp_path: Path) -> None:
    maps = [*MAPS[:1], "th2=D2,!D3", *MAPS[2:]]
    run = judged(probes_of(evidence), tmp_path, judge=CaptureJudge(maps=maps))
    assert run.reasons[0] == "th2 turns the other way: map its DIR as D3"
    assert run.clock.ppm == pytest.approx(PPM, abs=0.2)


@pytest.mark.slow
def test_swapped_channels_are_named(evidence: Evidence, tmp_path: Path) -> None:
    maps = ["th1=D2,D3", "th2=D0,D1", *MAPS[2:]]
    run = judged(probes_of(evidence), tmp_path, judge=CaptureJudge(maps=maps))
    assert run.reasons[0] == "th1 looks like the plan's th2, and th2 like its th1: swap their channels"


@pytest.mark.parametrize(("ppm", "passes"), [(199.0, True), (-199.0, True), (201.0, False), (2000.0, False)])
def test_clocks_that_differ_by_more_than_two_crystals_fail(
    evidence: Evidence, ppm: float, passes: bool, tmp_path: Path
) -> None:
    """A motion that is slow by 0.2 % looks right but for its clock."""
    run = judged(probes_of(evidence), tmp_path, ppm=ppm)
    assert run.clock.ppm == pytest.approx(ppm, abs=0.2)
    assert run.reasons == (() if passes else (f"the clocks differ by {run.clock.ppm:+.1f} ppm (limit 200)",))


def test_another_motion_is_not_found(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    rises = np.cumsum(random.uniform(3e-4, 2e-3, 900))
    turns = np.sort(random.uniform(0.0, 1.0, 400))
    probes = [
        Probe(f"D{i}", 0, np.column_stack([rises, rises + 33e-6]).ravel() if i % 2 == 0 else turns) for i in range(8)
    ]
    run = judged(probes, tmp_path)
    assert run.reasons[0].startswith("the plan is not in the capture")
    assert not run.passed


@pytest.mark.slow
def test_glitches_are_named_and_dropped_on_demand(evidence: Evidence, tmp_path: Path) -> None:
    probes = probes_of(evidence)
    times_s = probes[TH2_STEP].times_s
    at = (times_s[501::200] + times_s[502::200]) / 2
    spiked = changed(probes, TH2_STEP, np.sort(np.concatenate([times_s, at, at + 250e-9])))
    run = judged(spiked, tmp_path)
    assert not run.passed
    assert run.hints[0].startswith(f"th2: {at.size} pulses of STEP are far shorter than most")
    cleaned = judged(spiked, tmp_path, judge=CaptureJudge(maps=MAPS, glitch_s=1e-6))
    assert (cleaned.passed, cleaned.signals[1].glitches) == (True, at.size)


# --- the drivers


@pytest.mark.slow
def test_pulses_that_are_too_short_are_broken_at_a_rate_that_tells(evidence: Evidence, tmp_path: Path) -> None:
    """30 us are needed: 28 us are short at 8 MHz, and cannot be told at 200 kHz."""
    probes = probes_of(evidence)
    times_s = probes[TH2_STEP].times_s.copy()
    times_s[1::2] = times_s[0::2] + 28e-6
    short = changed(probes, TH2_STEP, times_s)
    told = [
        next(a for a in judged(short, tmp_path, rate_hz).seen.limits if (a.axis, a.limit.rule) == ("th2", "clk_high"))
        for rate_hz in (8e6, 2e5)
    ]
    assert [(answer.kept, answer.count) for answer in told] == [(Kept.BROKEN, 3064), (Kept.UNKNOWN, 3064)]
    assert told[0].limit.limit == pytest.approx(30.0, abs=0.02)


@pytest.mark.slow
def test_which_drivers_would_miss_pulses(evidence: Evidence, tmp_path: Path) -> None:
    run = judged(probes_of(evidence), tmp_path)
    told = {each.name: each for each in by_each_driver(run.capture, ROBOT, run.signals, run.clock)}
    assert (told["tmc2209"].missed, told["tmc2209"].first_s) == (0, None)
    assert told["chip-1000pf"].missed == 5128
    assert "16 is not one of a3967's 1, 2, 4, 8" in str(told["a3967"].refused)


def test_drives_that_are_off_are_seen_where_enable_was_recorded(evidence: Evidence, tmp_path: Path) -> None:
    probes = [*probes_of(evidence), Probe("D8", 1, np.array([evidence.start_counts / COUNTS_PER_SECOND + 0.5]))]
    maps = [MAPS[0], "th2=D2,D3,D8", *MAPS[2:]]
    run = judged(probes, tmp_path, judge=CaptureJudge(maps=maps))
    assert any("outputs were off: the motor did not follow" in reason for reason in run.reasons)
    assert "th2.ENABLE" not in run.assumed


def test_without_a_plan_steps_rates_and_limits_are_told(evidence: Evidence, tmp_path: Path) -> None:
    path = write_session(tmp_path / "a.sr", probes_of(evidence), 8e6)
    document = judge_alone(read_capture(path), ROBOT, CaptureJudge(maps=MAPS)).to_dict()
    assert [axis["steps"] for axis in document["axes"]] == [-1064, 3064, 0, -1000]
    assert document["axes"][1]["peak_rate_hz"] == pytest.approx(4598.0, rel=1e-3)
    assert (document["passed"], document["simulated"]) == (True, False)


def test_drivers_that_do_not_exist_are_refused(evidence: Evidence, tmp_path: Path) -> None:
    with refusing(InputError):
        judged(probes_of(evidence), tmp_path, 1e6, CaptureJudge(maps=MAPS, driver_profile="tmc"))
