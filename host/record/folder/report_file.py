"""Write and read the JSON files of a run's folder.

report.json holds names and traffic of a run, the planned changes of outputs, the figures, a fault. A feature has a
file of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving, judge_of
from steptwin.host.common.file_limits import REPORT_BYTES_MAX
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import Table, json_table
from steptwin.host.planning.motion import OutputChange
from steptwin.host.record.folder.layout import (
    REPORT,
    VERSION_KEY,
    MachineStop,
    check_version,
    existing_file,
    feature_file,
)
from steptwin.host.record.folder.unfinished import UnfinishedRecording, read_unfinished, unfinished
from steptwin.host.verify import (
    OWN_FIRMWARE,
    BusReport,
    Gates,
    RunInfo,
    any_step_rule,
)
from steptwin.protocol.timer import COUNTS_PER_SECOND

_FRAMES_MAX: Final = 1e15
"""Largest number of frames in a report: more than a bus carries in a machine's life."""


@dataclass(frozen=True, slots=True)
class StoredCapture:
    """Logic analyser capture of a report.

    Attributes:
        tolerance_steps: largest distance of a count from the plan.
        reasons: reasons for a failure that the folder does not show: wrong wiring, and different clocks.
    """

    tolerance_steps: float
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StoredReport:
    """A report read from its file.

    Attributes:
        run: facts of the run that the verifier cannot compute.
        output_changes: planned changes of outputs, in order of time.
        passed: the verdict; None if the board did not know the plan.
        driver_profile: name of the drivers on the board.
        axes: figures of each axis by name.
        fault: fault that ended the run; None if the run was complete.
        document: the whole document.
        recording: recording without an end that the report was made from; None for a report from a file.
        next_motion_s: start, since power-up, of a motion that is not in the plan; None without one.
        capture: capture of a real controller; None for an emulated run.
        kept: what features keep of it for a new verification, by key.
        stop: stop of a live board's machine since its motion began; None without one.
    """

    run: RunInfo
    output_changes: tuple[OutputChange, ...]
    passed: bool | None
    driver_profile: str
    axes: tuple[Mapping[str, Any], ...]
    fault: Mapping[str, Any] | None
    document: Mapping[str, Any]
    recording: UnfinishedRecording | None = None
    next_motion_s: float | None = None
    capture: StoredCapture | None = None
    kept: Mapping[str, Any] = field(default_factory=dict)
    stop: MachineStop | None = None

    @property
    def gates(self) -> Gates:
        """Gates of the run: another controller has a step rule of its own."""
        return OWN_FIRMWARE if self.capture is None else any_step_rule(self.capture.tolerance_steps)


def read_report(folder: Path) -> StoredReport:
    """Return a folder's report; for a recording without an end, the report that it would have.

    Raises:
        InputError: the file is missing or not JSON, has another version, or a key is missing or has another kind.
    """
    if unfinished(folder):
        return _of_recording(read_unfinished(folder))
    path = existing_file(folder, REPORT)
    with prefixed(f"{path}: "):
        return _report(json_table(read_text(str(path), REPORT_BYTES_MAX)))


def _report(table: Table) -> StoredReport:
    check_version(table.values.get(VERSION_KEY))
    return StoredReport(
        run=_run(table),
        output_changes=table.each("outputs", _switching),
        passed=None if table.is_null("passed") else table.truth("passed"),
        driver_profile=table.text("driver_profile"),
        axes=table.each("axes", lambda axis: axis.values),
        fault=_fault(table),
        next_motion_s=_next_motion_s(table),
        document=table.values,
        capture=_capture(table) if "capture" in table else None,
        kept={key: value for _, telling in giving("telling") for key, value in telling().kept(table).items()},
        stop=_stop(table) if "stopped" in table and not table.is_null("stopped") else None,
    )


def _stop(table: Table) -> MachineStop:
    with table.section("stopped") as stopped:
        at_s = _duration_s(stopped, "at_s")
        return MachineStop(round(at_s * COUNTS_PER_SECOND), stopped.text("by"), stopped.truth("in_motion"))


def stop_document(stop: MachineStop | None) -> dict[str, Any] | None:
    """Return a stop as the entry `stopped` of report.json."""
    if stop is None:
        return None
    return {"at_s": round(stop.counts / COUNTS_PER_SECOND, 6), "by": stop.by, "in_motion": stop.in_motion}


def _capture(table: Table) -> StoredCapture:
    with table.section("capture") as capture:
        tolerance_steps = capture.number("tolerance_steps")
        if not tolerance_steps > 0.0:
            raise InputError(f"tolerance_steps: {tolerance_steps:g} is not above 0")
        return StoredCapture(tolerance_steps, tuple(map(str, capture.elements("reasons"))))


def _of_recording(recording: UnfinishedRecording) -> StoredReport:
    return StoredReport(
        run=recording.run_info(),
        output_changes=(),
        passed=None,
        driver_profile=recording.header.driver_profile,
        axes=(),
        fault=None,
        next_motion_s=recording.mark.next_counts / COUNTS_PER_SECOND or None,
        document={"no_plan": recording.mark.no_plan},
        recording=recording,
        stop=recording.mark.stop,
    )


def _run(table: Table) -> RunInfo:
    with table.section("bus") as bus:
        traffic = BusReport(bus.integer("bitrate"), bus.integer("frames", _FRAMES_MAX), bus.number("load_percent"))
    return RunInfo(
        robot=table.text("robot"),
        job=table.text("job"),
        duration_s=_duration_s(table, "duration_s"),
        bus=traffic,
        simulated_s=_duration_s(table, "simulated_s"),
        wall_s=_duration_s(table, "wall_s"),
    )


def _duration_s(table: Table, key: str) -> float:
    value_s = table.number(key)
    if value_s < 0.0:
        raise InputError(f"{key}: {value_s:g} s is below 0")
    return value_s


def _switching(table: Table) -> OutputChange:
    return OutputChange(table.text("name"), table.truth("on"), table.number("from_s"), table.number("until_s"))


def _next_motion_s(table: Table) -> float | None:
    key = "next_motion_s"
    return _duration_s(table, key) if key in table and not table.is_null(key) else None


def _fault(table: Table) -> Mapping[str, Any] | None:
    """Check the keys of a fault that readers use, and return the whole fault; None without one."""
    if "fault" not in table.values:
        return None
    with table.section("fault") as fault:
        fault.text("message")
        fault.truth("positions_agree")
        with fault.section("joints") as joints:
            for name in joints:
                joints.number(name)
        return fault.values


def read_feature(folder: Path, name: str) -> tuple[Any, Any]:
    """Return a feature's evidence and expectation from its file.

    Raises:
        InputError: the file is missing or not JSON, or invalid for the feature.
    """
    path = existing_file(folder, feature_file(name))
    with prefixed(f"{path}: "):
        return judge_of(name).read(json_table(read_text(str(path), REPORT_BYTES_MAX)))
