"""The step timing of an axis and the step rate that it allows."""

from steptwin.controller.motion.step_config import StepConfig
from steptwin.protocol.timer import counts_of_ns
from tests.controller.units import STEP

CONFIG = StepConfig(16, 33_000, 33_666, 15_000, 15_000, velocity_max_units_per_s=20_000 * STEP)


def test_default_pulse_timing_allows_exactly_15_khz() -> None:
    assert counts_of_ns(33_000) + counts_of_ns(33_666) == 4800
    assert CONFIG.rate_limit_q16_per_ms == 15 << 16


def test_rate_limit_is_the_lower_of_velocity_and_pulse_timing() -> None:
    assert StepConfig(16, 33_000, 33_666, 0, 0, STEP * 1000).rate_limit_q16_per_ms == 1 << 16
    assert StepConfig(8, 33_000, 33_666, 0, 0, 2048 * 1000).rate_limit_q16_per_ms == 1 << 16
