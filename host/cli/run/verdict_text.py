"""Print the report of a verified run, for `run` and `verify`."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.output import Columns, fixed, print_rows, say
from steptwin.host.common.features import giving
from steptwin.host.record.verdict_words import verdict_words

if TYPE_CHECKING:
    from steptwin.host.verify.figures import ReportFigure

USUAL_DRIVERS: Final = "chip-330pf"
"""Driver profile that reports do not mention."""


def fault_line(fault: Mapping[str, Any]) -> str:
    """Return a line about the fault that ended a run: joint positions, and whether the drivers' counts agree."""
    joints = ", ".join(f"{name} = {fixed(value)}" for name, value in fault["joints"].items())
    agree = "as the drivers counted" if fault["positions_agree"] else "but the drivers counted otherwise"
    return f"{fault['message']}; stopped at {joints}, {agree}"


def print_report(document: Mapping[str, Any]) -> None:
    """Print the whole report, the verdict last."""
    if document["driver_profile"] != USUAL_DRIVERS:
        say(f"drivers: {document['driver_profile']}")
    print_axes(document)
    moving = [axis for axis in document["axes"] if axis["pulses"]]
    if moving:
        inverted = ", low while STEP is high" if moving[0]["active_edge"] == "falling" else ""
        say(f"CLK: high {_least(moving, 'clk_high_us_min')}, low {_least(moving, 'clk_low_us_min')}{inverted}")
    _print_outputs(document["outputs"])
    print_waits(document)
    for feature, lines in giving("report_lines"):
        if feature.name in document:
            for line in lines(document[feature.name]):
                say(line)
    _print_violations(document["violations"])
    tool = document["tool"]
    if tool:
        say(
            f"tool: {tool['position_error_mm_max']:.4f} mm max, {tool['position_error_mm_rms']:.4f} mm rms, "
            f"{tool['attitude_error_deg_max']:.4f} deg max"
        )
    for skew in document.get("skews", ()):
        apart = f"{skew['second']}: up to {skew['skew_max']:.4f} {skew['unit']} apart from {skew['first']}"
        say(f"{apart}, at the end {skew['skew_end']:+.4f} {skew['unit']}")
    if actual := document.get("actual_tool"):
        say(
            f"actual tool, with the robot's dh_errors: {actual['position_error_mm_max']:.4f} mm max,"
            f" {actual['position_error_mm_rms']:.4f} mm rms, {actual['attitude_error_deg_max']:.4f} deg max"
        )
    if document["simulated"]:
        _print_traffic(document)
    verdict, *reasons = verdict_words(document)
    say(f"{document['robot']} {document['job']}: {verdict}", *(f"  {reason}" for reason in reasons))


def _print_outputs(outputs: list[dict[str, Any]]) -> None:
    """Print the time of each output's change, or that it had the planned level already; nothing without any."""
    said = (
        f"{output['name']} {'on' if output['on'] else 'off'} "
        + ("already" if output["already"] else f"{output['changed_s']:.3f} s")
        for output in outputs
        if output["already"] or output["changed_s"] is not None
    )
    if text := ", ".join(said):
        say(f"outputs: {text}")


def _print_traffic(document: Mapping[str, Any]) -> None:
    """Print the load of the bus and the speed of the run; a capture of a real controller has neither."""
    bus = document["bus"]
    say(f"bus: {bus['frames']} frames at {bus['bitrate'] // 1000} kbit/s, {bus['load_percent']:.1f} % load")
    simulated_s, wall_s = document["simulated_s"], document["wall_s"]
    speed = f", {simulated_s / wall_s:.0f} x real time" if wall_s else ""  # a stored report may have 0
    say(f"SIMULATED {simulated_s:.2f} s in {wall_s:.2f} s{speed}")


def print_waits(document: Mapping[str, Any]) -> None:
    """Print the duration of each wait for an input; nothing for a motion without one."""
    said = (
        f"{wait['input']} {'on' if wait['on'] else 'off'} for {wait['stood_s']:.3f} s from {wait['at_s']:.3f} s"
        + (", then timed out" if wait.get("timed_out") else "")
        for wait in document.get("waits", ())
    )
    if text := ", ".join(said):
        say(f"waited: {text}")


def _print_violations(violations: list[dict[str, Any]]) -> None:
    """Print a table for each violated limit, with a row for each axis."""
    for what, source in dict.fromkeys((v["broken"], v["source"]) for v in violations):
        say(f"{what} ({source})")
        same = [v for v in violations if (v["broken"], v["source"]) == (what, source)]
        unit = same[0]["unit"]
        columns: Columns = {
            "axis": "{0[axis]}",
            "times": "{0[count]}",
            f"worst {unit}": "{0[worst]:.2f}",
            f"limit {unit}": "{0[limit]:.2f}",
            "first s": "{0[first_s]:.6f}",
        }
        print_rows(columns, same)


def _least(axes: list[dict[str, Any]], key: str) -> str:
    times_us = [axis[key] for axis in axes if axis[key] is not None]
    return f"at least {min(times_us):.2f} us" if times_us else "once"


def print_axes(document: Mapping[str, Any]) -> None:
    """Print a row for each axis, with the document's figures of core and features."""
    from steptwin.host.verify.figures import figure_values

    columns: Columns = {
        figure.column: partial(_cell, figure, values)
        for figure, values in figure_values(document["axes"], document)
        if figure.heading
    }
    print_rows(columns, document["axes"])


def _cell(figure: "ReportFigure[Any]", values: Mapping[str, Any], axis: Mapping[str, Any]) -> str:
    still = figure.moving and axis["mean_step_interval_us"] is None
    return "-" if still else figure.form.format(values[axis["name"]])
