"""Make the table of a job's result on a paper's page, beside the paper's own samples."""

from dataclasses import dataclass
from typing import Final

from docs.generate.markdown import table
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.verify.figures import AxisReport
from steptwin.host.verify.report import Report


@dataclass(frozen=True, slots=True)
class PaperSamples:
    """A motion at its paper's samples with joints rounded to whole steps, computed independently of this project.

    Attributes:
        samples: number of samples.
        pulses: for each joint the sum of |differences| between successive rounded positions.
        tool_mm: largest distance between the tool's positions with rounded and with exact joints.
    """

    samples: int
    pulses: tuple[int, ...]
    tool_mm: float


SAMPLED: Final = {
    ("lab-scara", "spiral"): PaperSamples(377, (752, 3747, 4523, 772), 0.156142),
    ("warehouse-scara", "pull-line"): PaperSamples(1001, (0, 0, 0, 1846, 880, 710), 0.089622),
    ("teaching-scara", "carry"): PaperSamples(68, (1064, 3064, 0, 1000), 0.051643),
    ("calibration-scara", "demo"): PaperSamples(101, (2667, 2000, 16000, 1600), 0.167033),
    ("hybrid-arm", "helix"): PaperSamples(241, (8624, 90328, 122392, 1728), 0.085095),
}
"""For each robot and job, with the job's default options."""


def results(outcome: Outcome) -> str:
    """Return a table with a row for each axis, then a list of the tool, the outputs and the verdict."""
    report = outcome.report
    sampled = SAMPLED.get((report.run.robot, report.run.job))
    columns = ["axis", "steps at start", "at end", "pulses", "reversals", "peak steps/s", "error max, steps"]
    rows = [_row(axis) for axis in report.axes]
    if sampled:
        columns.insert(4, "pulses in samples")
        for row, pulses in zip(rows, sampled.pulses, strict=True):
            row.insert(4, str(pulses))
    samples = " The samples are the paper's, with joints rounded to whole steps." if sampled else ""
    before = f"Steps as the drivers counted them; a perfect counter has an error of 0.5625.{samples}"
    lines = [_tool(report, sampled), *_outputs(report), _verdict(report)]
    return "\n".join([before, "", table(columns, rows), "", *(f"- {line}" for line in lines)])


def _row(axis: AxisReport) -> list[str]:
    counts = [axis.name, *(str(count) for count in (axis.steps_start, axis.steps_end, axis.pulses, axis.reversals))]
    if not axis.pulses:
        return [*counts, "-", "-"]
    return [*counts, f"{axis.peak_rate_hz:.1f}", f"{axis.position_error_steps_max:.4f}"]


def _tool(report: Report, sampled: PaperSamples | None) -> str:
    tool = report.tool
    compared = f" ({sampled.tool_mm:.4f} mm in the {sampled.samples} samples)" if sampled else ""
    return (
        f"tool: at most {tool.position_error_mm_max:.4f} mm{compared} and {tool.attitude_error_deg_max:.4f} deg off,"
        f" {tool.position_error_mm_rms:.4f} mm rms"
    )


def _outputs(report: Report) -> list[str]:
    switched = [
        f"{output.output} {'on' if output.on else 'off'} at {output.changed_s:.3f} s" for output in report.outputs
    ]
    return [f"outputs: {', '.join(switched)}"] if switched else []


def _verdict(report: Report) -> str:
    verdict = "PASSED" if report.passed else f"FAILED: {'; '.join(report.reasons)}"
    return f"{report.run.duration_s:g} s of motion: {verdict}"
