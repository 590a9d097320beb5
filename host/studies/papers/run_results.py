"""Show the outcome of a job's run, which a paper has no counterpart for: it measured no pulses."""

from collections.abc import Callable

from steptwin.host.studies.papers.paper import Listing, S, Value
from steptwin.host.twin.embedded.outcome import Outcome


def pulses_of(outcome: Outcome, joint: str) -> int:
    """Return the pulses of a joint's axis; raise KeyError for an unknown joint."""
    return {axis.name: axis.pulses for axis in outcome.report.axes}[joint]


def run_listing(job: str, outcome: Callable[[S], Outcome]) -> Listing[S]:
    """Return the table of a run: a row for each axis, then the tool and the verdict."""
    return Listing(
        f"The run of `{job}` on the emulated board",
        ("axis", "steps at start", "at end", "pulses", "peak steps/s", "error max, steps"),
        lambda study: _rows(outcome(study)),
    )


def tool_values(outcome: Callable[[S], Outcome]) -> tuple[Value[S], ...]:
    """Return the largest error of the tool by the driver's counts, and the verdict; no paper has them."""
    return (
        Value(
            "tool off the plan by the counted steps, max", "mm", None,
            lambda study: outcome(study).report.tool.position_error_mm_max, decimals=4,
        ),
        Value("checks of the run that failed", "", None, lambda study: len(outcome(study).report.reasons)),
    )  # fmt: skip


def _rows(outcome: Outcome) -> list[list[str]]:
    return [
        [
            axis.name,
            str(axis.steps_start),
            str(axis.steps_end),
            str(axis.pulses),
            f"{axis.peak_rate_hz:.1f}" if axis.pulses else "-",
            f"{axis.position_error_steps_max:.4f}" if axis.pulses else "-",
        ]
        for axis in outcome.report.axes
    ]
