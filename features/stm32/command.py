"""`steptwin run-image FILE --robot ROBOT`: run the file that is flashed into an STM32F103, and tell what it does."""

import re
from dataclasses import MISSING
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, positive_number
from steptwin.host.cli.options import argument, naming_options, option, switch
from steptwin.host.cli.output import number_of, print_table, say, warn
from steptwin.host.common.bad_input import known
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.features.stm32.running import ImageRun

_FORMS: Final = {"auto": None, "python": False, "numba": True}
_UNITS_S: Final = {"s": 1.0, "ms": 1e-3}
_USUAL_S: Final = 10.0
"""Longest time for which a text is waited for, unless `--for` says more."""


@command("firmware.elf --robot my-arm.toml --for 2s", "firmware.bin --robot my-arm.toml --until done --json")
def run_image(
    answer: AnswerOptions,
    file: Path = argument("FILE", "The ELF or .bin that is flashed into the STM32F103.", MISSING),
    robot: str | None = option("ROBOT", "Robot file with a table [stm32]: the chip's pins."),
    for_: str | None = option("TIME", "How long it runs on the board, such as 2s or 50ms; 2s.", "--for"),
    until: str | None = option("TEXT", "Run until a USART has sent this text, at most 10s or the time of --for."),
    send: str = option("TEXT", "Text for USART1, from the beginning on; \\n ends a line.", default=""),
    can: Path | None = option("FILE", "CAN frames for the board, in the format of `candump -L`, from power-up on."),
    flash: Path | None = option("FILE", "Keep what the image programs into its flash in this file."),
    strict: bool = switch("Fail at an access that is not modelled."),
    kernel: str = option(
        "NAME", "Form of the chip: python, numba (compiled), or auto: numba if it is there.", default="auto"
    ),
) -> None:
    """Run the file that is flashed into an STM32F103, and tell what the drivers make of its pins.

    Exit code 1: a driver's limit was broken, the processor faulted, a wired pin was never an output, or no USART has
    sent the text of --until.
    """
    from steptwin.features.stm32 import running
    from steptwin.host.robots import load_robot

    if robot is None:
        raise InputError("--robot is missing: a robot file with a table [stm32], which says how the pins are wired")
    compiled = _FORMS.get(known("--kernel", kernel, _FORMS))
    if compiled and find_spec("numba") is None:
        raise InputError(f"--kernel numba: needs numba: {installing('fast')}; python needs nothing")
    for_s = _USUAL_S if for_ is None and until is not None else _time_s(for_ or "2s")
    with naming_options(image="FILE "):
        run = running.run_image(
            file,
            load_robot(robot),
            for_s=for_s,
            until=until,
            strict=strict,
            given=send.replace("\\n", "\n"),
            can_script=can,
            flash=flash,
            compiled=compiled,
        )
    answer.tell(run.to_dict(), lambda: _print(run))
    for hint in run.hints:
        warn(hint)
    end_unless(run.passed)


def _time_s(text: str) -> float:
    found = re.fullmatch(r"([0-9.]+) ?(s|ms)", text)
    if not found:
        raise InputError(f"--for {text}: is no time with a unit, such as 2s or 50ms")
    return positive_number(found[1], "--for") * _UNITS_S[found[2]]


def _print(run: "ImageRun") -> None:
    from steptwin.features.stm32.running import COST_PERCENT

    rows = [
        [
            axis.name,
            str(axis.pulses),
            f"{axis.steps:+d}",
            str(axis.missed),
            str(axis.reversals),
            f"{axis.peak_rate_hz:.0f}",
            _figure(axis.high_us_min),
            _figure(axis.low_us_min),
            _figure(axis.jitter_us_p99),
            _figure(axis.jitter_us_max),
        ]
        for axis in run.axes
    ]
    headings = ["axis", "pulses", "steps", "missed", "turns", "peak Hz", "high us", "low us", "jitter 99 %", "max us"]
    print_table(headings, rows, text_columns=1)
    for number, (taken, latest_us) in run.interrupts.items():
        name = f"interrupt {number - 16}" if number >= 16 else _SYSTEM.get(number, f"exception {number}")
        say(f"{name}: taken {number_of(taken, 'time')}, at most {latest_us:.3g} us after it was due")
    for name, text in run.sent.items():
        for line in text.splitlines()[-_LINES:]:
            say(f"{name}: {line}")
    if run.frames:
        say(f"CAN: {number_of(len(run.frames), 'frame')}; the last ones:")
    for counts, frame in run.frames[-_LINES:]:
        say(f"CAN: {counts / COUNTS_PER_SECOND:.6f} s {frame.cob_id:03X}#{frame.data.hex().upper()}")
    say(*(f"reason: {reason}" for reason in run.reasons))
    say(
        f"times within a stretch of instructions may be wrong by {COST_PERCENT} % of it",
        f"{run.image} on {run.robot}, {run.simulated_s:.6g} s in {run.wall_s:.3g} s:"
        f" {'PASSED' if run.passed else 'FAILED'}",
    )


_SYSTEM: Final = {11: "SVC", 14: "PendSV", 15: "SysTick"}
_LINES: Final = 10
"""Last lines of a USART, and frames, that are printed."""


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
