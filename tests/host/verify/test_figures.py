"""Figures of an axis: computed by hand, and declared in one place for all that shows them."""

from dataclasses import make_dataclass, replace
from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pytest

from steptwin.host.cli.run.verdict_text import print_axes
from steptwin.host.common import features
from steptwin.host.common.features import Feature
from steptwin.host.verify import figures, verify
from steptwin.host.verify.figures import (
    AxisReport,
    ReportFigure,
    SeenAxis,
    axis_figures,
    clk_high_us_min,
    clk_low_us_min,
    judged_document,
    mean_step_interval_us,
    peak_rate_hz,
    reversals,
)
from tests.host.verify.motions import RUN, expect, line, motion, perfect_evidence, still
from tests.host.verify.test_counted import PULSES

BOTH = expect(motion(0.1, line(0.0, 100.0), still(1.0)), 10.0, 10.0)
"""A joint that makes 100 steps, and one that makes none."""


def test_figures_of_pulses_by_hand() -> None:
    assert (reversals(PULSES), peak_rate_hz(PULSES)) == (1, 72_000.0)
    assert mean_step_interval_us(PULSES) == pytest.approx(1250 / 72)
    assert clk_high_us_min(PULSES) == pytest.approx(100 / 72)
    assert clk_low_us_min(PULSES) == 12.5


def test_figures_without_a_pulse() -> None:
    none = np.empty(0, np.int64)
    axis = replace(
        PULSES, step_counts=none, step_signs=none.astype(np.int8), clk_rise_counts=none, clk_fall_counts=none
    )
    assert (reversals(axis), peak_rate_hz(axis)) == (0, 0.0)
    assert (mean_step_interval_us(axis), clk_high_us_min(axis), clk_low_us_min(axis)) == (None, None, None)


def test_the_edges_alone_give_these_figures() -> None:
    assert [key for key, figure in axis_figures().items() if figure.exact] == [
        "name", "steps_start", "steps_end", "pulses", "reversals", "peak_rate_hz", "clk_high_us_min", "clk_low_us_min",
        "violations", "mean_step_interval_us", "active_edge",
    ]  # fmt: skip


def test_columns_have_a_dash_for_an_axis_that_did_not_move(capsys: pytest.CaptureFixture[str]) -> None:
    print_axes(verify(BOTH, perfect_evidence(BOTH), RUN).to_dict())
    heading, _, moved, stood = capsys.readouterr().out.splitlines()
    assert " ".join(heading.split()) == "axis start end pulses peak Hz err steps p50 us p99 us broken"
    assert moved.split() == ["a", "0", "100", "100", "1000.0", "0.5625", "0.00", "0.00", "0"]
    assert stood.split() == ["b", "10", "10", "0", "-", "-", "-", "-", "0"]


FASTEST = ReportFigure[figures.AxisRun](
    "shortest interval of two steps",
    lambda axis: float(np.diff(axis.evidence.step_counts).min(initial=2**31) / 72),
    unit="us",
    heading="fastest",
    form="{:.0f}",
    moving=True,
    exact=True,
)


def test_a_figure_is_added_in_one_place(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """It stands in report.json and in the printed verdict, and `verify` compares it."""
    wider = make_dataclass("Wider", [("fastest_us", Annotated[float, FASTEST])], bases=(AxisReport,), frozen=True)
    monkeypatch.setattr(figures, "AxisReport", wider)
    document = verify(BOTH, perfect_evidence(BOTH), RUN).to_dict()
    assert list(document["axes"][0])[-2:] == ["active_edge", "fastest_us"]
    assert document["axes"][0]["fastest_us"] == pytest.approx(1000.0, abs=0.02)
    print_axes(document)
    heading, _, moved, stood = (line.split() for line in capsys.readouterr().out.splitlines())
    assert (heading[-2:], moved[-1], stood[-1]) == (["fastest", "us"], "1000", "-")
    assert axis_figures()["fastest_us"].exact


def test_a_feature_declares_figures_in_the_same_form(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    turns = ReportFigure[SeenAxis]("turns", lambda axis: axis.seen[axis.name], heading="turns", form="{:.1f}")
    judge = SimpleNamespace(document=lambda _, start_counts: {"since": start_counts})
    worn = Feature(name="worn", judge=lambda: judge, figures=lambda: {"turns": turns})
    monkeypatch.setattr(features, "registered", lambda: ({"worn": worn}, {}))
    own = judged_document("worn", {"a": 2.0, "b": 0.5}, 7, ("a", "b"))
    assert own == {"since": 7, "axes": {"a": {"turns": 2.0}, "b": {"turns": 0.5}}}
    print_axes(verify(BOTH, perfect_evidence(BOTH), RUN).to_dict() | {"worn": own})
    heading, _, moved, stood = (line.split() for line in capsys.readouterr().out.splitlines())
    assert (heading[-1], moved[-1], stood[-1]) == ("turns", "2.0", "0.5")
