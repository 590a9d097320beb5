"""What drivers make of a capture without a plan: steps without ENABLE, at either edge, and limits by their grades."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from steptwin.features.captures.capture import Capture, Channel
from steptwin.features.captures.each_driver import by_each_driver
from steptwin.features.captures.judging import AloneRun, CaptureJudge, judge_alone
from steptwin.host.common.errors import InputError
from steptwin.host.record.bus_log import read_frames
from steptwin.host.record.recorded_bus import read_bus
from steptwin.host.robots import load_robot
from steptwin.protocol.drivers import DriverFigures

RATE_HZ = 8e6
ROBOT = load_robot("teaching-scara")
MAPS = ("th1=0,1,2", "th2=3,4", "d3=5,6", "th4=7,8")
GENERIC = DriverFigures(microsteps=(8, 16), steplen_ns=1_000, stepspace_ns=1_000, dirsetup_ns=1_000, dirhold_ns=1_000)


def alone(
    driver: str | None, step: Sequence[float], *, level: int = 0, enable: tuple[float, ...] = (), end_s: float = 1.0
) -> AloneRun:
    """Judge STEP of one axis, in seconds, with ENABLE on until it changes; the other axes rest."""

    def channel(name: str, level: int, times_s: Sequence[float]) -> Channel:
        return Channel(name, level, np.rint(np.asarray(times_s) * RATE_HZ).astype(np.int64))

    rest = [channel(str(number), 0, ()) for number in range(3, 9)]
    channels = (channel("0", level, step), channel("1", 0, ()), channel("2", 1, enable), *rest)
    robot = ROBOT
    if driver == "generic":
        robot = replace(ROBOT, board=replace(ROBOT.board, osc_pf=None, driver_profile="generic", driver=GENERIC))
    capture = Capture("test", channels, 1.0 / RATE_HZ, round(end_s * RATE_HZ), RATE_HZ, sampled=True)
    return judge_alone(capture, robot, CaptureJudge(maps=MAPS, driver_profile=driver))


def pulses(count: int, width_s: float = 50e-6, begin_s: float = 0.3) -> list[float]:
    return [begin_s + n * 1e-3 + after for n in range(count) for after in (0.0, width_s)]


@pytest.mark.parametrize("driver", [None, "drv8825", "a4988", "dm542", "tb6600", "generic"])
def test_steps_while_enable_is_off_fail_whether_the_chip_counts_them_or_not(driver: str | None) -> None:
    """ENABLE goes off after 10 of 20 pulses; a bare TB6560 counts on with its outputs off, a DRV8825 does not."""
    assert alone(driver, pulses(20)).passed
    run = alone(driver, pulses(20), enable=(0.3095,))
    assert not run.passed
    assert any("10" in reason for reason in run.reasons)
    assert run.to_dict()["reasons"] == list(run.reasons)


def test_enable_that_changes_within_a_sample_of_step_cannot_be_told() -> None:
    run = alone("drv8825", pulses(5), enable=(0.304,))
    assert run.passed
    assert [str(answer.kept) for answer in run.limits if answer.limit.rule == "disabled"] == ["cannot be told"]


@pytest.mark.parametrize("driver", [None, "drv8825", "tb6600", "slow-blue-board"])
def test_each_active_edge_is_a_step_where_step_rests_high(driver: str | None) -> None:
    """Ten low pulses of 200 us: ten rises, and ten falls for the board that steps at falls."""
    run = alone(driver, pulses(10, 200e-6), level=1)
    assert [axis["steps"] for axis in run.to_dict()["axes"]] == [-10, 0, 0, 0]
    assert run.passed


def test_a_pulse_that_the_end_cuts_is_a_step_whose_length_cannot_be_told() -> None:
    run = alone(None, [0.3, 0.30005, 0.301], end_s=0.301 + 10e-6)
    assert run.to_dict()["axes"][0]["steps"] == -2
    assert [str(a.kept) for a in run.limits if (a.axis, a.limit.rule) == ("th1", "clk_high")] == ["cannot be told"]


def test_which_drivers_would_miss_steps_without_enable() -> None:
    run = alone(None, pulses(20), enable=(0.3095,))
    told = {each.name: each.missed for each in by_each_driver(run.capture, ROBOT, run.signals, run.clock)}
    assert (told["a4988"], told["drv8825"], told["chip-330pf"]) == (10, 10, 10)


def test_each_limit_says_how_it_is_known() -> None:
    said = {str(answer) for answer in alone("a4988", pulses(2, 0.5e-6)).limits}
    assert "th1: clk_high 1 us (datasheet): broken, 2 times" in said
    said = {str(answer) for answer in alone("tb6600", pulses(2, 4.5e-6)).limits}
    assert "th1: clk_high 5 us (assumed): broken, 2 times; cannot be told for certain, no source states it" in said
    said = {str(answer) for answer in alone("drv8825", pulses(2)).limits}
    assert "th1: clk_high 1.903 us (quoted): kept" in said
    assert "th1: dir_hold 0.2083 us (datasheet): kept" in {str(each) for each in alone("a4988", pulses(2)).limits}


def test_kept_limits_show_the_stricter_figure() -> None:
    """Not the input stage's: a count for a pulse behind wires, and DIR's hold less the couplers' delays."""
    told = {answer.limit.rule: answer.limit.limit for answer in alone("a4988", pulses(2)).limits}
    assert told["clk_high"] == pytest.approx(1.0, abs=0.01)
    told = {answer.limit.rule: answer.limit.limit for answer in alone("3a-module", pulses(2)).limits}
    assert told["dir_hold"] > -5.0


def test_step_and_dir_exchanged_are_named() -> None:
    run = alone(None, ())
    step, direction = run.signals[0].step, run.signals[0].direction
    signals = replace(run.signals[0], direction=direction._replace(times_s=np.linspace(0.0, 0.1, 100)), step=step)
    wrong = replace(run, signals=(signals, *run.signals[1:]))
    assert wrong.reasons == ("th1: STEP and DIR look exchanged: map=th1=1,0,2",)


def test_candumps_format_for_people_names_the_one_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_text("  can0  211   [8]  11 22 33 44 55 66 77 88\n", encoding="ascii")
    for read in (read_bus, lambda log: list(read_frames(log))):
        with pytest.raises(InputError, match="line 1: is what candump shows to people"):
            read(path)
