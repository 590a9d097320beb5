"""Run an image on a robot's machine for a time, or until it says something, and judge what the drivers saw."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from steptwin.controller.motion.backend import python_kernel
from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.emulator.simulation import Simulation
from steptwin.features.stm32.can_script import CanScript, frame_texts
from steptwin.features.stm32.firmware import ImageFirmware
from steptwin.features.stm32.gdb_server import GdbServer
from steptwin.features.stm32.options import Stm32Options
from steptwin.features.stm32.outcome import StrangeAccess, strange_accesses
from steptwin.features.stm32.part import ImagePart
from steptwin.features.stm32.pin_log import EDGES_MAX, PinLog
from steptwin.features.stm32.profile import ImageProfile, profile_of
from steptwin.features.stm32.script import ScriptLine
from steptwin.features.stm32.section import OUTPUTS, ChipPin, JointPins, wiring_of
from steptwin.features.stm32.tools import STEP_S, ExpectationError, ImageTools
from steptwin.host.cli.output import number_of
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.record.bus_log import read_frames
from steptwin.host.record.waveforms import Format, HeldValues, Signal, SignalKind, Window, write_waveform
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts
from steptwin.host.twin.machine.evidence import axes_evidence
from steptwin.host.twin.machine.machine_options import AS_FILED, MachineOptions
from steptwin.host.verify import AxisEvidence, Evidence
from steptwin.host.verify.figures import clk_high_us_min, clk_low_us_min, peak_rate_hz, reversals
from steptwin.host.verify.report import ViolationReport, violation_reports
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US

COST_PERCENT: Final = 25
"""By how much the time of a stretch of instructions may be wrong: docs/firmware.md says how this is known."""
_NEIGHBOURS: Final = 5
_SMOOTH: Final = 1.5


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
        interrupts: by number of the exception, how often it was taken, the longest time until its handler in us, and
            the events that came before the last one was served.
        profile: where the time went, and the stack.
        sent: what each USART has sent, by its name.
        frames: frames on the CAN bus, each with the instant when it became valid.
        happened: what features tell of the machine, such as what has become of each fault.
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
    interrupts: dict[int, tuple[int, float, int]]
    profile: ImageProfile
    sent: dict[str, str]
    frames: tuple[tuple[int, Frame], ...]
    happened: Mapping[str, Any]
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
                {"exception": number, "taken": taken, "latest_us": latest, "missed": missed}
                for number, (taken, latest, missed) in self.interrupts.items()
            ],
            "profile": self.profile.to_dict(),
            "sent": self.sent,
            "can": frame_texts(self.frames),
            **self.happened,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPlan:
    """How long an image runs, what happens meanwhile, and what is looked at.

    Attributes:
        for_s: longest time, in the board's time.
        until_text: a text that ends the run when a USART has sent it; the run fails if none has.
        script: what is sent and expected; the run ends with it, and fails if the image does not answer.
        machine: how the machine differs from the robot's file, and what goes wrong with it meanwhile.
        strict: an access that is not modelled, and an event that was missed, fails the run.
        vcd: file for the waveform of pins; None: none.
        pins: these pins, by number; empty: those that are wired.
        can_script: frames that the host sends, with their instants, in the format of `candump -L`.
        flash: file that keeps what the image programs into its flash.
        compiled: True for the chip compiled by numba, False for plain Python, None for numba where it is installed.
        debugger: its server; the run begins when it has let it.
    """

    for_s: float
    until_text: str | None = None
    script: Sequence[ScriptLine] = ()
    machine: MachineOptions = AS_FILED
    strict: bool = False
    vcd: Path | None = None
    pins: Sequence[ChipPin] = ()
    can_script: Path | None = None
    flash: Path | None = None
    compiled: bool | None = None
    debugger: GdbServer | None = None


class _TimeIsUpError(Exception):
    """The longest time of a run is over."""


def run_image(path: Path, robot: Robot, plan: RunPlan) -> ImageRun:
    """Run an image on a robot's machine, whose joints have pins.

    Raises:
        InputError: the image cannot run on this chip, or has not reached its `main`, or the robot has no chip.
    """
    begun_s = perf_counter()
    image = Stm32Options(image=path, flash=plan.flash).fitted(robot, Path(), compiled=plan.compiled)
    others = [each for each in plan.machine.extras if not isinstance(each, Stm32Options)]
    options = replace(plan.machine, extras=(image, *others))
    parts = MachineParts.of(robot, python_kernel(), options)
    simulation = (machine := EmulatedMachine(parts)).simulation
    part = machine.parts.features["stm32"]
    assert isinstance(part, ImagePart)
    if plan.can_script is not None:
        simulation.join(CanScript(simulation, read_frames(plan.can_script)))
    tools, reasons, found_s = _run(simulation, part, plan)
    firmware, chip = tools.firmware, tools.chip
    if not reasons and chip.main_ahead:
        raise InputError(
            f"{path}: has not reached main after {plan.for_s:g} s: the processor is at {firmware.image.place(chip.pc)}"
        )
    if plan.until_text is not None and found_s is None:
        reasons.append(f"no USART has sent {plan.until_text!r} within {plan.for_s:g} s")
    axes = axes_evidence(machine, currents=False)
    violations = violation_reports(Evidence(0, axes))
    if error := firmware.can.error(machine.bus.bitrate):
        reasons.append(error)
    strange = strange_accesses(chip, firmware.image)
    reasons += _wrong_outputs(firmware, wiring_of(robot))
    reasons += [
        f"{each.axis}: {each.broken}: {number_of(each.count, 'time')}, first at {each.first_s:.6f} s:"
        f" {each.worst:.3g} {each.unit}, limit {each.limit:.3g} {each.unit} ({each.source})"
        for each in violations
    ]
    hints = [
        f"not modelled: {each.kind} {each.name}, {number_of(each.times, 'time')}, first at {each.first}"
        for each in strange
    ]
    hints += [
        f"{exception_name(number)}: {number_of(missed, 'event')} came before the last one was served,"
        " or were set too late"
        for number, (_, _, missed) in chip.interrupts.items()
        if missed
    ]
    if plan.vcd is not None:
        _write_vcd(plan.vcd, tools, plan.pins, simulation.now_counts, f"{path.name} on {robot.name}")
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
        profile=profile_of(chip, firmware.image),
        frames=tuple(machine.bus_log),
        sent={f"USART{number}": usart.text for number, usart in enumerate(tools.usarts, start=1) if usart.text},
        happened=machine.parts_document(),
        reasons=tuple(reasons + (hints if plan.strict else [])),
        hints=() if plan.strict else tuple(hints),
    )
    firmware.end()
    return run


def _run(simulation: Simulation, part: ImagePart, plan: RunPlan) -> tuple[ImageTools, list[str], float | None]:
    """Let the image run; return its tools, why it failed so far, and when the text came that was waited for."""
    end_counts = round(plan.for_s * COUNTS_PER_SECOND)

    def wait(dt_s: float) -> None:
        until_counts = simulation.now_counts + max(round(dt_s * COUNTS_PER_SECOND), 1)
        simulation.run_until(min(until_counts, end_counts))
        if until_counts > end_counts:
            raise _TimeIsUpError

    tools = part.tools(wait)
    tools.firmware.edges = PinLog(None if plan.vcd else EDGES_MAX)
    reasons, found_s = list[str](), None
    look_counts = end_counts if plan.until_text is None else round(STEP_S * COUNTS_PER_SECOND)
    try:
        if plan.debugger is not None:
            plan.debugger.start(tools.chip)
            tools.firmware.debugger = plan.debugger
        for line in plan.script:
            reasons += _played(line, tools, plan.for_s)
            if reasons:
                break
        while not plan.script and simulation.now_counts < end_counts and found_s is None:
            simulation.run_until(min(simulation.now_counts + look_counts, end_counts))
            if plan.until_text is not None and any(plan.until_text in usart.text for usart in tools.usarts):
                found_s = simulation.now_s
    except FirmwareError as error:
        reasons.append(str(error))
    finally:
        if plan.debugger is not None:
            plan.debugger.close()
    return tools, reasons, found_s


def _played(line: ScriptLine, tools: ImageTools, for_s: float) -> list[str]:
    """Play a line of a script; return why the run fails by it, if it does."""
    try:
        line.play(tools)
    except ExpectationError as error:
        return [f"{line.place}: {error}"]
    except _TimeIsUpError:
        return [f"{line.place}: its time is beyond the {for_s:g} s of the run: --for sets them"]
    return []


def _write_vcd(path: Path, tools: ImageTools, pins: Sequence[ChipPin], end_counts: int, title: str) -> None:
    signals = []
    for pin in pins or [ChipPin(number) for number in sorted(tools.firmware.wired_pins)]:
        counts, levels = tools.firmware.edges.of(pin.number)
        initial = 1 - int(levels[0]) if levels.size else tools.chip.level(pin.number)
        signals.append(Signal("chip", pin.name, SignalKind.WIRE, HeldValues(counts, levels, initial)))
    write_waveform(path, signals, Window(0, end_counts, 0), Format.VCD, title)


SYSTEM_EXCEPTIONS: Final = {11: "SVC", 14: "PendSV", 15: "SysTick"}


def exception_name(number: int) -> str:
    """Return the name of an exception, such as SysTick, or interrupt 28."""
    return f"interrupt {number - 16}" if number >= 16 else SYSTEM_EXCEPTIONS.get(number, f"exception {number}")


def _wrong_outputs(firmware: ImageFirmware, wiring: Mapping[str, JointPins]) -> list[str]:
    """Return the wired pins that the image has not made outputs, or not for good."""
    assert firmware.chip is not None
    found = []
    for name, pins in wiring.items():
        for key in OUTPUTS:
            if (pin := pins.pin(key)) is None:
                continue
            if not firmware.chip.was_output(pin.number):
                found.append(f"{name}: {pin.name}, its {key.upper()}, was never an output")
            elif firmware.chip.left_output(pin.number):
                found.append(f"{name}: {pin.name}, its {key.upper()}, became an input after it had been an output")
    return found
