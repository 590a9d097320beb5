"""`steptwin run-image FILE --robot ROBOT`: run the file that is flashed into an STM32F103, and tell what it does."""

from contextlib import closing, nullcontext
from dataclasses import MISSING, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from steptwin.features.stm32.section import ChipPin
from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, Replace, keep_files, machine_for
from steptwin.host.cli.options import Without, argument, naming_options, option, switch
from steptwin.host.cli.output import number_of, print_table, say, warn
from steptwin.host.common.bad_input import known, prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.features.stm32.profile import ImageProfile
    from steptwin.features.stm32.running import ImageRun

_FORMS: Final = {"auto": None, "python": False, "numba": True}
_LONGEST_S: Final = 3600.0
_FUNCTIONS_SHOWN: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthOptions:
    """Options for the end of an image's run; without one it runs 2 s."""

    for_: str | None = option("TIME", "Longest time on the board, such as 2s or 50ms.", "--for")
    until_text: str | None = option("TEXT", "Run until a USART has sent this text; --for is 10s then.")
    script: Path | None = option("FILE", "Play this script of sent and expected lines, and end with it.")

    @property
    def for_s(self) -> float:
        """Longest time in seconds; raises InputError for a text that is no time, or a time that is 0."""
        from steptwin.features.stm32.script import duration_s

        if self.until_text is not None and self.script is not None:
            raise InputError("--until-text and --script: a script ends by itself: give only one of them")
        usual = "2s" if self.until_text is None and self.script is None else "10s"
        time_s = duration_s(self.for_ or usual)
        if time_s is None:
            raise InputError(f"--for {self.for_}: is no time with a unit, such as 2s, 50ms or 100us")
        if not 0.0 < time_s <= _LONGEST_S:
            raise InputError(f"--for {self.for_}: is not above 0 and at most {_LONGEST_S:g}s")
        return time_s


@dataclass(frozen=True, slots=True, kw_only=True)
class VcdOptions:
    """Options for a file with the waveform of pins."""

    vcd: Path | None = option("FILE", "Write the waveform of pins, for PulseView and GTKWave.")
    pins: str | None = option("PIN,...", "These pins, such as PA0,PB5; by default those that are wired.")
    replace: Replace = False

    def chosen(self) -> list[ChipPin]:
        """Return the pins; raise InputError for one that the chip does not have, or for a file that exists."""
        if self.pins is not None and self.vcd is None:
            raise InputError("--pins: is for the waveform of --vcd FILE")
        keep_files([] if self.vcd is None else [self.vcd], replace=self.replace)
        if self.vcd is not None and not self.vcd.parent.is_dir():
            raise InputError(f"--vcd {self.vcd}: there is no folder {self.vcd.parent}")
        with prefixed("--pins: "):
            return [ChipPin.of(name.strip()) for name in (self.pins or "").split(",") if name.strip()]


@command(
    "firmware.elf --robot my-arm.toml --for 2s",
    "fw.elf --robot arm.toml --script moves.txt --vcd pins.vcd",
)
def run_image(
    answer: AnswerOptions,
    length: LengthOptions,
    waveform: VcdOptions,
    machine: Annotated[MachineOptions, Without(())],
    file: Path = argument("FILE", "The ELF or .bin that is flashed into the STM32F103.", MISSING),
    robot: str | None = option("ROBOT", "Robot file with the pins of the chip (docs/firmware.md)."),
    can: Path | None = option("FILE", "CAN frames for the board, in the format of `candump -L`, from power-up on."),
    flash: Path | None = option("FILE", "Keep what the image programs into its flash in this file."),
    strict: bool = switch("Fail at an access that is not modelled, and at an event that was missed."),
    gdb: int | None = option("PORT", "Wait for gdb at this port of this machine; 0 takes a free one."),
    kernel: str = option(
        "NAME", "Form of the chip: python, numba (compiled), or auto: numba if it is there.", default="auto"
    ),
) -> None:
    """Run the file that is flashed into an STM32F103, and tell what the drivers make of its pins.

    Exit code 1: a driver's limit was broken, the processor faulted, a wired pin was no output, no USART has sent the
    text of --until-text, or the image did not answer as the script expects.
    """
    from steptwin.features.stm32.gdb_server import GdbServer
    from steptwin.features.stm32.running import RunPlan
    from steptwin.features.stm32.running import run_image as run_it
    from steptwin.features.stm32.script import read_script
    from steptwin.host.robots import load_robot

    if robot is None:
        raise InputError("--robot is missing: a robot file whose joints have tables [joints.NAME.pins]")
    compiled = _FORMS.get(known("--kernel", kernel, _FORMS))
    if compiled and find_spec("numba") is None:
        raise InputError(f"--kernel numba: needs numba: {installing('fast')}; python needs nothing")
    for_s, pins = length.for_s, waveform.chosen()
    script = () if length.script is None else read_script(length.script)
    loaded = load_robot(robot)
    machine = machine_for(loaded, machine)
    with naming_options("gdb"), nullcontext() if gdb is None else closing(GdbServer(gdb)) as debugger:
        if debugger is not None:
            say(f"waiting for gdb: target remote 127.0.0.1:{debugger.port}", err=True)
        plan = RunPlan(
            for_s=for_s,
            until_text=length.until_text,
            script=script,
            machine=machine,
            strict=strict,
            vcd=waveform.vcd,
            pins=pins,
            can_script=can,
            flash=flash,
            compiled=compiled,
            debugger=debugger,
        )
        with naming_options(image="FILE "):
            run = run_it(file, loaded, plan)
    answer.tell(run.to_dict(), lambda: _print(run))
    for hint in run.hints:
        warn(hint)
    end_unless(run.passed)


def _print(run: "ImageRun") -> None:
    from steptwin.features.stm32.running import COST_PERCENT, exception_name

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
    for number, (taken, latest_us, _) in run.interrupts.items():
        if not taken:
            continue
        say(f"{exception_name(number)}: taken {number_of(taken, 'time')}, at most {latest_us:.3g} us after it was due")
    _print_profile(run.profile)
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


def _print_profile(profile: "ImageProfile") -> None:
    for function in profile.functions[:_FUNCTIONS_SHOWN]:
        say(f"{function.percent:5.1f} %  {function.name}")
    others = sum(each.percent for each in profile.functions[_FUNCTIONS_SHOWN:])
    if others:
        say(f"{others:5.1f} %  ({number_of(len(profile.functions) - _FUNCTIONS_SHOWN, 'other function')})")
    say(f"{profile.exceptions_percent:5.1f} %  (to handlers and back)", f"{profile.asleep_percent:5.1f} %  (asleep)")
    if profile.masked_by:
        say(f"interrupts off for at most {profile.masked_us_max:.3g} us, from {profile.masked_by}")
    if profile.flash_writes or profile.flash_erases:
        written, erased = number_of(profile.flash_writes, "half-word"), number_of(profile.flash_erases, "erase")
        say(f"flash: {written} programmed, {erased}")
    say(f"main stack: {profile.stack_used_bytes} of {profile.stack_bytes} bytes used")


_LINES: Final = 10
"""Last lines of a USART, and frames, that are printed."""


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
