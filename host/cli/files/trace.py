"""`steptwin trace DIR`: write the waveform of a stored run, for logic analysers, viewers and tables."""

from dataclasses import dataclass
from dataclasses import replace as replace_fields
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, Replace, RunDir, chosen_names, keep_files
from steptwin.host.cli.options import option
from steptwin.host.cli.output import warn
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.record.waveforms import Format, Signal, Window
    from steptwin.host.robots.robot import Robot
    from steptwin.host.verify import Evidence


_FormatName = Literal["vcd", "vcd-full", "csv", "npz", "mcap"]
"""Formats of `steptwin.host.record.waveforms`, repeated here: its import would slow down `--help`."""

_SCALED: Final = ("vcd", "vcd-full")
"""Formats with a time unit."""


@dataclass(frozen=True, slots=True)
class PartOptions:
    """Options for a part of a record."""

    from_s: float | None = option("SECONDS", "First time of the motion; by default all.", "--from")
    to_s: float | None = option("SECONDS", "Last time of the motion.", "--to")
    axes: list[str] | None = option("AXIS,...", "Only these axes; repeatable.", "--axis")

    @property
    def is_whole(self) -> bool:
        """True if no option is given."""
        return self.from_s is None and self.to_s is None and not self.axes

    def signals(self, signals: "list[Signal]", evidence: "Evidence") -> "list[Signal]":
        """Return the signals of the named axes, in their own order; by default all."""
        if not self.axes:
            return signals
        chosen = chosen_names("--axis", self.axes, (axis.name for axis in evidence.axes))
        return [signal for signal in signals if signal.axis in chosen]

    def window(self, evidence: "Evidence") -> "Window":
        """Return the part of the record between two times of the motion."""
        from steptwin.host.record.waveforms import whole_record

        whole = whole_record(evidence)
        if whole.from_counts == whole.to_counts:
            raise InputError("no pin has changed since power-up: there is no waveform")
        window = replace_fields(
            whole,
            from_counts=whole.from_counts if self.from_s is None else _counts(whole, "--from", self.from_s),
            to_counts=whole.to_counts if self.to_s is None else _counts(whole, "--to", self.to_s),
        )
        if window.from_counts >= window.to_counts:
            first_s, last_s = window.time_s(window.from_counts), window.time_s(window.to_counts)
            raise InputError(f"--from {first_s:g} s: is not before --to, {last_s:g} s")
        return window


@dataclass(frozen=True, slots=True, kw_only=True)
class WaveformOptions(AnswerOptions):
    """Options for the form and the file of a waveform."""

    form: _FormatName = option(
        "FORMAT",
        "vcd: 1-bit wires, for sigrok; vcd-full: with positions, states and currents, for GTKWave; csv, npz: the wires"
        " as a table, as arrays; mcap: everything, for Foxglove.",
        "--format",
        default="vcd",
    )
    timescale: Literal["1us", "100ns", "10ns"] | None = option(
        "UNIT",
        "Unit of time in VCD files: 1us, 100ns, 10ns; by default the coarsest that lets no wire change twice. A finer"
        " one slows sigrok.",
    )
    out: Path | None = option(
        "FILE",
        "File to write; by default in the folder: trace.vcd, trace-full.vcd, ..., or trace-part.vcd, ... for a part.",
    )
    replace: Replace = False

    def check(self) -> None:
        """Raise InputError for a time scale in a format without one, and for an existing file."""
        if self.timescale is not None and self.form not in _SCALED:
            raise InputError(f"--timescale {self.timescale}: is for {' and '.join(_SCALED)}, not for {self.form}")
        if self.out is not None:
            keep_files([self.out], replace=self.replace)


@command("out/pick", "out/pick --format csv --axis J1,J2 --from 1 --to 2")
def trace(wanted: WaveformOptions, part: PartOptions, folder: RunDir) -> None:
    """Write the waveform of a stored run: every edge of every pin, or a part of it."""
    from steptwin.host.record.folder import EDGES, RECORDING, check_axes, read_evidence, read_recording, read_robot
    from steptwin.host.record.waveforms import SCALES, Format, write_waveform

    wanted.check()
    form, scale = Format(wanted.form), SCALES[wanted.timescale] if wanted.timescale else None
    evidence, robot, recording = read_evidence(folder), read_robot(folder), read_recording(folder)
    check_axes(folder / (RECORDING if recording else EDGES), evidence, robot)
    if recording:
        warn(f"{folder}: {recording.interruption}")
    frames = recording.mark.frames if recording else None
    window = part.window(evidence)
    signals = part.signals(_signals(folder, evidence, robot, form, frames), evidence)
    path = wanted.out or folder / (form.file_name if part.is_whole else form.part_file_name)
    write_waveform(path, signals, window, form, robot.name, scale)
    from_s, to_s = window.time_s(window.from_counts), window.time_s(window.to_counts)
    names = [signal.name for signal in signals]
    wanted.tell(
        {"file": str(path), "format": wanted.form, "signals": names, "from_s": from_s, "to_s": to_s},
        f"{path}: {len(signals)} signals from {from_s:.6f} to {to_s:.6f} s of the motion",
    )


def _signals(folder: Path, evidence: "Evidence", robot: "Robot", form: "Format", frames: int | None) -> "list[Signal]":
    from steptwin.host.record.folder.layout import BUS_LOG, existing_file
    from steptwin.host.record.waveforms import drive_states, everything, wires

    if form.wires_only:
        return wires(evidence)
    states = drive_states(existing_file(folder, BUS_LOG), len(evidence.axes), frames)
    return everything(evidence, robot, states)


def _counts(whole: "Window", option: str, t_s: float) -> int:
    counts = whole.counts(t_s) if isfinite(t_s) else -1
    if not whole.from_counts <= counts <= whole.to_counts:
        first_s, last_s = whole.time_s(whole.from_counts), whole.time_s(whole.to_counts)
        raise InputError(f"{option} {t_s:g} s: the record goes from {first_s:.6f} to {last_s:.6f} s of the motion")
    return counts
