"""Run an image on a robot's machine for a time, or until it says something, and judge what the drivers saw."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from steptwin.controller.motion.backend import python_kernel
from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.stm32.firmware import ImageFirmware
from steptwin.features.stm32.options import Stm32Options
from steptwin.features.stm32.outcome import StrangeAccess, strange_accesses
from steptwin.features.stm32.section import OUTPUTS, Stm32
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts
from steptwin.host.twin.machine.evidence import axes_evidence
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.host.verify import AxisEvidence, Evidence
from steptwin.host.verify.figures import clk_high_us_min, clk_low_us_min, peak_rate_hz, reversals
from steptwin.host.verify.report import ViolationReport, violation_reports
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND, COUNTS_PER_US

COST_PERCENT: Final = 25
"""By how much the time of a stretch of instructions may be wrong: docs/firmware.md says how this is known."""
_NEIGHBOURS: Final = 5
_SMOOTH: Final = 1.5
_TEXT_MS: Final = 1
"""How often it is looked whether a text has been sent."""


@dataclass(frozen=True, slots=True)
class AxisVerdict:
    """What one axis' driver made of its pins.

    Attributes:
        name: name of the axis.
        pulses: rises of STEP.
        steps: net steps that the driver counted.
        missed: pulses that it did not count.
        reversals: steps the other way than the one before.
        peak_rate_hz: of the steps.
        high_us_min: shortest time that CLK is high; None without pulses.
        low_us_min: likewise low.
        jitter_us_p99: how far a rise of STEP is from where a smooth motion has it, for 99 of 100; None with less than
            five pulses of a smooth motion.
        jitter_us_max: the largest such distance.
    """

    name: str
    pulses: int
    steps: int
    missed: int
    reversals: int
    peak_rate_hz: float
    high_us_min: float | None
    low_us_min: float | None
    jitter_us_p99: float | None
    jitter_us_max: float | None


def axis_verdict(axis: AxisEvidence) -> AxisVerdict:
    """Return the figures of one axis."""
    jitter = _jitter_us(axis)
    return AxisVerdict(
        name=axis.name,
        pulses=axis.clk_rise_counts.size,
        steps=int(axis.step_signs.sum(dtype=np.int64)),
        missed=axis.clk_rise_counts.size - axis.step_counts.size,
        reversals=reversals(axis),
        peak_rate_hz=peak_rate_hz(axis),
        high_us_min=clk_high_us_min(axis),
        low_us_min=clk_low_us_min(axis),
        jitter_us_p99=float(np.percentile(jitter, 99)) if jitter.size else None,
        jitter_us_max=float(jitter.max()) if jitter.size else None,
    )


def _jitter_us(axis: AxisEvidence) -> FloatArray:
    """Return how far each pulse is from where a smooth motion had it, by its two neighbours on each side.

    A cubic through the four neighbours is such a motion. Where an interval is half as long again as another one of the
    four, a motion begins or ends, which is not smooth.
    """
    counts = axis.clk_rise_counts.astype(np.float64)
    if counts.size < _NEIGHBOURS:
        return np.empty(0)
    intervals = np.lib.stride_tricks.sliding_window_view(np.diff(counts), _NEIGHBOURS - 1)
    smooth = intervals.max(axis=1) < _SMOOTH * intervals.min(axis=1)
    off: FloatArray = np.abs(np.diff(counts, n=4))[smooth] / 6 / COUNTS_PER_US
    return off


@dataclass(frozen=True, slots=True)
class ImageRun:
    """An image's run and its verdict.

    Attributes:
        image: the file.
        robot: name of the robot.
        simulated_s: time that has passed on the board.
        wall_s: time that this took.
        found_s: when the text had been sent that was waited for; None if it was not, or none was.
        axes: what the drivers made of their pins.
        violations: limits of the drivers that were broken.
        strange: accesses whose effect is not modelled.
        interrupts: by number of the exception, how often it was taken and the longest time until its handler in us.
        sent: what each USART has sent, by its name.
        reasons: one line for each reason why the run fails.
        hints: what a user should know although it fails nothing.
    """

    image: Path
    robot: str
    simulated_s: float
    wall_s: float
    found_s: float | None
    axes: tuple[AxisVerdict, ...]
    violations: tuple[ViolationReport, ...]
    strange: tuple[StrangeAccess, ...]
    interrupts: dict[int, tuple[int, float]]
    sent: dict[str, str]
    reasons: tuple[str, ...]
    hints: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """True if no reason speaks against it."""
        return not self.reasons

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict for JSON."""
        return {
            "image": str(self.image),
            "robot": self.robot,
            "passed": self.passed,
            "reasons": list(self.reasons),
            "hints": list(self.hints),
            "simulated_s": self.simulated_s,
            "wall_s": round(self.wall_s, 3),
            "found_s": self.found_s,
            "time_uncertainty_percent": COST_PERCENT,
            "axes": [asdict(axis) for axis in self.axes],
            "violations": [asdict(each) for each in self.violations],
            "not_modelled": [each.to_dict() for each in self.strange],
            "interrupts": [
                {"exception": number, "taken": taken, "latest_us": latest}
                for number, (taken, latest) in self.interrupts.items()
            ],
            "sent": self.sent,
        }


def run_image(
    path: Path,
    robot: Robot,
    *,
    for_s: float,
    until: str | None = None,
    strict: bool = False,
    given: str = "",
    compiled: bool | None = None,
) -> ImageRun:
    """Run an image on a robot's machine.

    Args:
        path: the file that is flashed.
        robot: a robot with a table `[stm32]`.
        for_s: how long, in the board's time.
        until: a text that ends the run when a USART has sent it; the run fails if none has.
        strict: an access that is not modelled fails the run.
        given: text that arrives at USART1 from the beginning on.
        compiled: True for the chip compiled by numba, False for plain Python, None for numba where it is installed.

    Raises:
        InputError: the image cannot run on this chip, or has not reached its `main`, or the robot has no chip.
    """
    begun_s = perf_counter()
    options = Stm32Options(image=path).fitted(robot, Path(), compiled=compiled)
    parts = MachineParts.of(robot, python_kernel(), MachineOptions(extras=(options,)))
    simulation = (machine := EmulatedMachine(parts)).simulation
    firmware = simulation.boards[0].running
    assert isinstance(firmware, ImageFirmware)
    assert firmware.chip is not None
    chip = firmware.chip
    if given:
        chip.give(0, given.encode())
    reasons, found_s, end_counts = [], None, round(for_s * COUNTS_PER_SECOND)
    try:
        while simulation.now_counts < end_counts and found_s is None:
            step_counts = end_counts if until is None else simulation.now_counts + _TEXT_MS * COUNTS_PER_MS
            simulation.run_until(min(step_counts, end_counts))
            if until is not None and any(until in _text(chip.sent(usart)) for usart in range(3)):
                found_s = simulation.now_s
    except FirmwareError as error:
        reasons.append(str(error))
    if not reasons and chip.main_ahead:
        raise InputError(
            f"{path}: has not reached main after {for_s:g} s: the processor is at {firmware.image.place(chip.pc)}"
        )
    if until is not None and found_s is None:
        reasons.append(f"no USART has sent {until!r} within {for_s:g} s")
    axes = axes_evidence(machine, currents=False)
    violations = violation_reports(Evidence(0, axes))
    strange = strange_accesses(chip, firmware.image)
    table = robot.sections["stm32"]
    assert isinstance(table, Stm32)
    reasons += _never_outputs(firmware, table, robot.axis_names)
    reasons += [
        f"{each.axis}: {each.broken}: {each.count} times, first at {each.first_s:.6f} s:"
        f" {each.worst:.3g} {each.unit}, limit {each.limit:.3g} {each.unit} ({each.source})"
        for each in violations
    ]
    told = [f"not modelled: {each.kind} {each.name}, {each.times} times, first at {each.first}" for each in strange]
    reasons += told if strict else []
    run = ImageRun(
        image=path,
        robot=robot.name,
        simulated_s=simulation.now_s,
        wall_s=perf_counter() - begun_s,
        found_s=found_s,
        axes=tuple(map(axis_verdict, axes)),
        violations=violations,
        strange=tuple(strange),
        interrupts=chip.interrupts,
        sent={f"USART{i + 1}": text for i in range(3) if (text := _text(chip.sent(i)))},
        reasons=tuple(reasons),
        hints=() if strict else tuple(told),
    )
    firmware.end()
    return run


def _never_outputs(firmware: ImageFirmware, table: Stm32, names: Sequence[str]) -> list[str]:
    assert firmware.chip is not None
    return [
        f"{name}: {pin.name}, its {key.upper()}, was never an output"
        for name in names
        for key in OUTPUTS
        if (pin := table.joints[name].pin(key)) is not None and not firmware.chip.was_output(pin.number)
    ]


def _text(sent: bytes) -> str:
    return sent.decode("utf-8", errors="replace")
