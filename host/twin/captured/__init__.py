"""Captures of a real controller, judged: what the robot's drivers would have made of its edges, beside a plan."""

from steptwin.host.twin.captured.judging import CapturedRun, CaptureJudge, judge_alone, judge_capture
from steptwin.host.twin.captured.other_drivers import DriverAnswer, by_each_driver

__all__ = ["CaptureJudge", "CapturedRun", "DriverAnswer", "by_each_driver", "judge_alone", "judge_capture"]
