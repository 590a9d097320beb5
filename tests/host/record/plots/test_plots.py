"""Pictures are drawn for every kind of run, say what they show, and lose no peak."""

import re
import warnings
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.poses import POSITION
from steptwin.host.verify import Comparison, DriverLimit, Expectation, Phases, RateRamps, compare
from steptwin.protocol.drivers import ActiveEdge
from tests.host.verify.motions import (
    NO_VIOLATIONS,
    RUN,
    START_COUNTS,
    altered,
    expect,
    line,
    motion,
    perfect_evidence,
    sines,
    still,
    trapezoid,
)

pytest.importorskip("matplotlib")

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Tick
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import StepPatch
from matplotlib.text import Text

from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES, RUN_PICTURES, PlotView, draw_picture, write_plots
from steptwin.host.record.plots.canvas import DOTS_PER_INCH, SHEET_STYLE, envelope, plain_texts, save_figure, thinned
from steptwin.host.record.plots.picture import PIXELS
from steptwin.host.record.plots.shown_run import PlotMoment, ShownRun
from steptwin.host.verify import verify_comparison
from tests.host.record.plots.drawn import drawn_points
from tests.host.record.plots.png import pixels

VIEW = PlotView(1.0, 0.05)


def document(comparison: Comparison) -> dict[str, Any]:
    return verify_comparison(comparison, RUN).to_dict()


def draw(picture: str, comparison: Comparison, view: PlotView = VIEW) -> Figure:
    shown = ShownRun(comparison, document(comparison) if picture == "overview" else {}, view)
    return draw_picture(PICTURES[picture], RUN, shown)


def write(folder: Path, names: Iterable[str], comparison: Comparison, form: str = "png") -> list[Path]:
    return write_plots(folder, names, RUN, comparison, document(comparison), form)


@cache
def swinging() -> Comparison:
    """Return a run with two axes that move, the first to and fro, and one that stands still."""
    expected = expect(
        motion(2.0, sines([(20.0, 3.0, 0.0)]), trapezoid(3.0, -50.0, 2.0, 0.5), still(7.5)), 80.0, 40.0, 10.0
    )
    return compare(expected, perfect_evidence(expected))


@cache
def standing() -> Comparison:
    expected = expect(motion(1.0, still(1.0), still(2.0)), 10.0, 10.0)
    return compare(expected, perfect_evidence(expected))


@cache
def steady() -> Comparison:
    """Return a run at constant speeds: a step of a every 250 us, and one of b every 500 us."""
    expected = expect(motion(1.1, line(0.0, 50.0), line(3.0, -50.0), still(7.5)), 80.0, 40.0, 10.0)
    return compare(expected, perfect_evidence(expected))


@cache
def single_step() -> Comparison:
    expected = expect(motion(1.0, line(0.0, 0.7)), 1.0)
    return compare(expected, perfect_evidence(expected))


@cache
def silent() -> Comparison:
    """Return a run whose board made no pulse of its plan."""
    expected = swinging().expected
    none, no_signs = np.empty(0, np.int64), np.empty(0, np.int8)
    evidence = perfect_evidence(expected)
    for axis in range(2):
        evidence = altered(
            evidence,
            axis,
            clk_rise_counts=none,
            clk_fall_counts=none,
            dir_edge_counts=none,
            dir_levels=no_signs,
            step_counts=none,
            step_signs=no_signs,
        )
    return compare(expected, evidence)


@cache
def unheard() -> Comparison:
    """Return a run whose drivers missed every pulse."""
    expected = swinging().expected
    evidence = perfect_evidence(expected)
    for axis in range(2):
        evidence = altered(evidence, axis, step_counts=np.empty(0, np.int64), step_signs=np.empty(0, np.int8))
    return compare(expected, evidence)


@cache
def dense() -> Comparison:
    """Return a run with more steps than a picture has columns, so that they are thinned."""
    expected = expect(motion(1.6, sines([(80.0, 2.0, 0.0)]), sines([(80.0, 2.0, 1.5)])), 80.0, 80.0)
    return compare(expected, perfect_evidence(expected))


RUNS = {run.__name__: run for run in (swinging, steady, standing, single_step, silent, unheard, dense)}


@cache
def drawn(picture: str, run: str = "steady", view: PlotView = VIEW) -> Figure:
    """Return a picture for tests that only look at it."""
    return draw(picture, RUNS[run](), view)


@pytest.mark.parametrize(
    "run", ["standing", *(pytest.param(run, marks=pytest.mark.slow) for run in RUNS if run != "standing")]
)
def test_every_picture_is_drawn_of_every_run(run: str) -> None:
    """They are not written here, which would take ten times as long; those of `steady` are looked at below too."""
    for picture in PICTURES:
        assert drawn(picture, run, PlotView() if PICTURES[picture].close_up else VIEW).axes


def check_files(paths: list[Path]) -> None:
    """Check that every picture is written, as wide as it should be."""
    assert [path.name for path in paths] == [
        "overview.png", "error.png", "joints.png", "step-rates.png", "tool-path.png", "tool-pose.png", "in-space.png",
        "timing.png", "jitter.png", "widths.png", "edges.png", "phases.png",
    ]  # fmt: skip
    for path in paths:
        width, height = pixels(path)
        assert width == PIXELS
        assert 200 <= height <= 4 * width
        assert path.stat().st_size > 5_000


@pytest.mark.slow
def test_all_pictures_of_a_run_are_written(tmp_path: Path) -> None:
    """Those of a run that stands still are written below."""
    check_files(write(tmp_path / "made" / "on demand", PICTURES, steady()))


@pytest.mark.parametrize("picture", PICTURES)
def test_a_picture_says_what_it_shows(picture: str) -> None:
    figure = drawn(picture)
    assert figure.get_suptitle().startswith("test-arm · test · ")
    assert figure.get_suptitle().endswith("(SIMULATED)")
    first = min(axes.get_position().x0 for axes in figure.axes)
    for axes in figure.axes:
        labels = axes.get_ylabel() + axes.get_xlabel()
        beside = axes.get_position().x0 > first  # it shares the unit of its neighbour
        assert "[" in labels or ", in ms" in labels or labels.startswith("DIR") or beside


def lane_names(axes: Axes) -> list[str]:
    """Return the labels of a panel's lanes, without their figures."""
    return [label.get_text().split("\n")[0] for label in axes.get_yticklabels()]


@pytest.mark.parametrize(
    "picture", ["overview", "error", "joints", "step-rates", "timing", "jitter", "widths", "phases"]
)
def test_joints_without_motion_are_named_in_a_note(picture: str) -> None:
    figure = drawn(picture)
    assert figure.get_supxlabel() == "Not shown, because without motion: c at 7.5 deg"
    names = {name for axes in figure.axes for name in (*lane_names(axes), axes.get_ylabel().split(" ")[0])}
    assert {"a", "b"} <= names
    assert "c" not in names


def test_each_moving_joint_has_panels_or_a_lane() -> None:
    assert lane_names(drawn("error").axes[0]) == ["a", "b", "tool", "attitude"]
    assert lane_names(drawn("overview").axes[2]) == ["a", "b"]
    rows = {name: len(drawn(name).axes) for name in PICTURES}
    assert rows == {
        "overview": 3, "error": 2, "joints": 6, "step-rates": 4, "tool-path": 3, "tool-pose": 8, "in-space": 2,
        "timing": 2, "jitter": 4, "widths": 2, "edges": 1, "phases": 4,
    }  # fmt: skip


class TestOfARobot:
    """A move of the classroom arm: th1 and th2 by 90 deg at up to 90 deg/s, with the elbow at 0 and 90 deg."""

    @staticmethod
    @cache
    def run() -> Comparison:
        robot = load_robot("teaching-scara")
        move = joint_move(robot.joint_names, (0.0, 0.0, 0.0, 0.0), (90.0, 90.0, 0.0, 0.0), Cubic(1.0, 1.5))
        expected = Expectation.of(robot, move)
        return compare(expected, perfect_evidence(expected))

    def test_accelerations_and_near_limits_are_drawn(self) -> None:
        """From 6 * 90 / 1.5^2 = 240 deg/s^2 to -240; the speed's limit of 180 deg/s is as far as the curve is high."""
        position, speed, acceleration = draw("joints", self.run(), VIEW).axes[:3]
        t_s, values = drawn_points(acceleration.lines[0]).T
        assert values[1:-1] == pytest.approx(240.0 - 320.0 * t_s[1:-1], abs=0.2)
        assert [axes.get_title(loc="right") for axes in (position, speed, acceleration)] == [
            "limit ±130", "limit ±180", "limit ±1000",
        ]  # fmt: skip
        dashed = [
            [line for line in axes.lines if line.get_linestyle() == "--"] for axes in (position, speed, acceleration)
        ]
        assert [[drawn_points(line)[0, 1] for line in lines] for lines in dashed] == [[130.0], [180.0], []]

    def test_the_arm_is_drawn_at_start_and_end(self) -> None:
        whole = draw("tool-path", self.run(), VIEW).axes[0]
        links = {line.get_label(): drawn_points(line) for line in whole.lines}
        assert links["arm at the start"] == pytest.approx(np.array([[0.0, 0.0], [95.0, 0.0]]), abs=1e-9)
        assert links["arm at the end"] == pytest.approx(np.array([[0.0, 0.0], [0.0, 95.0]]), abs=1e-9)
        assert whole.get_title(loc="left") == "with the arm, true to scale"

    def test_guides_do_not_widen_the_view(self) -> None:
        """The warehouse's rail is 2 m long, the path a few mm."""
        robot = load_robot("warehouse-scara")
        move = joint_move(robot.joint_names, (0, 0, 100, 0, 60, 30), (0, 0, 100, -1, 60, 31), Cubic(1.0, 0.2))
        expected = Expectation.of(robot, move)
        figure = draw("tool-path", compare(expected, perfect_evidence(expected)), VIEW)
        figure.axes[0].apply_aspect()
        left, right = figure.axes[0].get_xlim()
        assert right - left < 1000.0

    def test_the_tools_pose_is_counted(self) -> None:
        """At the end x is -100, y 95 and z -40 mm; the attitude is 180 deg, not -180, after rising to it."""
        figure = draw("tool-pose", self.run(), VIEW)
        ends = [[drawn_points(line)[-1, 1] for line in axes.lines] for axes in figure.axes]
        for column, expected in zip(ends[::2], (-100.0, 95.0, -40.0, 180.0), strict=True):
            assert column == pytest.approx([expected, expected], abs=0.05)
        cosines = np.array(ends[1:6:2])
        assert cosines == pytest.approx(np.diag([-1.0, -1.0, 1.0]), abs=1e-3)


def test_a_third_coordinate_that_moves_gets_a_view() -> None:
    comparison = swinging()

    def lifted(joints: FloatArray) -> FloatArray:
        return np.column_stack([joints[:, 0], joints[:, 1], joints[:, 1] / 2.0, joints[:, 2]])

    expected = replace(comparison.expected, forward=lifted)
    assert len(draw("tool-path", compare(expected, comparison.evidence), VIEW).axes) == 6


def test_the_actual_tool_has_lanes_of_its_own_in_the_error_picture() -> None:
    comparison = standing()
    expected = replace(comparison.expected, actual_forward=comparison.expected.forward)
    lanes = lane_names(draw("error", compare(expected, comparison.evidence), VIEW).axes[0])
    assert lanes == ["tool", "attitude", "actual tool", "actual attitude"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "axis", "angle"),
    [("ar4-mk3", "z", "orientation"), ("teaching-scara", "x", "attitude")],
)
def test_a_run_in_space_shows_where_the_tool_points(name: str, axis: str, angle: str) -> None:
    """By arrows that begin on the path; frames of base, joints and tool on request."""
    robot = load_robot(name)
    goal = tuple(home + 1.0 for home in robot.home)
    expected = Expectation.of(robot, joint_move(robot.joint_names, robot.home, goal, Cubic(1.0, 0.2)))
    comparison = compare(expected, perfect_evidence(expected))
    near, whole = draw("in-space", comparison, VIEW).axes
    collections: list[Any] = list(near.collections)
    arrows = [np.array(arrow._segments3d)[0] for arrow in collections]  # noqa: SLF001 - nothing public tells
    tools = tool_frames(make_kinematics(robot), np.array([robot.home, goal]))
    for tool, (end_mm, start_mm) in zip(tools, (arrows[0], arrows[-1]), strict=True):
        assert start_mm == pytest.approx(tool[:3, 3], abs=1e-6)
        way_mm = end_mm - start_mm
        assert way_mm / np.linalg.norm(way_mm) == pytest.approx(tool[:3, "xyz".index(axis)], abs=1e-9)
    with_frames = draw("in-space", comparison, PlotView(frames=True)).axes[1]
    frames = len(robot.joints) + 2
    assert len(with_frames.get_lines()) == len(whole.get_lines()) + 3 * frames
    assert angle in lane_names(draw("error", comparison, VIEW).axes[0])


def test_a_tool_that_never_turns_has_no_angle_in_its_error_picture() -> None:
    comparison = swinging()
    expected = replace(comparison.expected, task=POSITION)
    lanes = lane_names(draw("error", compare(expected, comparison.evidence), VIEW).axes[0])
    assert lanes == ["a", "b", "tool"]


class TestAToolThatStandsStill:
    """Its x is zero except for rounding, which differs from instant to instant."""

    def comparison(self) -> Comparison:
        comparison = standing()

        def forward(joints: FloatArray) -> FloatArray:
            x_mm = np.where(np.arange(len(joints)) % 2, 4.9e-14, 5.0e-14)
            return np.column_stack([x_mm, np.full(len(joints), 800.0), np.zeros((len(joints), 2))])

        return compare(replace(comparison.expected, forward=forward), comparison.evidence)

    @pytest.mark.slow
    def test_has_pictures_without_a_warning(self, tmp_path: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_files(write(tmp_path, PICTURES, self.comparison()))

    def test_is_drawn_with_its_surroundings(self) -> None:
        figure = draw("tool-path", self.comparison(), VIEW)
        for axes in figure.axes:
            axes.apply_aspect()
        whole, magnified, close = figure.axes
        for first, last, middle in ((*whole.get_xlim(), 0.0), (*whole.get_ylim(), 800.0)):
            assert last - first >= 1.0
            assert (first + last) / 2 == pytest.approx(middle, abs=1e-9)
        assert (whole.get_xlabel(), whole.get_ylabel()) == ("x [mm]", "y [mm]")
        assert not magnified.axison
        assert [text.get_text() for text in magnified.texts] == ["the tool does not move"]
        assert close.axison

    def test_has_no_close_view_in_its_error_picture(self) -> None:
        whole, close = draw("error", self.comparison(), VIEW).axes
        assert lane_names(whole) == ["tool", "attitude"]
        assert [text.get_text() for text in close.texts[1:]] == ["no step counted"] * 2

    def test_has_no_limits_of_joints_in_its_error_picture(self) -> None:
        assert draw("error", self.comparison(), VIEW).axes[0].texts[0].get_text() == "whole motion"
        of_joints = drawn("error").axes[0]
        assert of_joints.texts[0].get_text() == "whole motion; dashed: limit of 0.57 steps"


def test_pictures_of_a_short_time_say_around_which_instant() -> None:
    *said, attitude = (text.get_text() for text in drawn("error").axes[1].texts[1:])
    assert len(said) == 3
    assert all(re.fullmatch(r"\d+\.\d{4} s ± [\d.]+ ms", text) for text in said)
    assert attitude == "no step counted"
    for picture in ("edges", "phases"):
        labels = [axes.get_xlabel() for axes in drawn(picture).axes]
        assert [label for label in labels if re.match(r"around t = \d+\.\d{4,6} s, in ms", label)], (picture, labels)


@pytest.mark.slow
def test_many_edges_are_drawn_as_an_envelope() -> None:
    """Each lane has a band between two lines; few edges are one line."""
    many, few = (
        [each for each in drawn("error", run).axes[0].collections if isinstance(each, PolyCollection)]
        for run in ("dense", "single_step")
    )
    assert len(many) >= 2
    assert not few


def test_an_error_that_is_visible_is_not_magnified() -> None:
    titles = {run: drawn("tool-path", run).axes[1].get_title(loc="left") for run in ("swinging", "silent", "unheard")}
    assert titles["silent"] == titles["unheard"] == "error not magnified"
    assert titles["swinging"].startswith("error magnified ")


@pytest.mark.slow
def test_the_pictures_of_a_run_have_the_names_of_their_files(tmp_path: Path) -> None:
    paths = write(tmp_path, RUN_PICTURES, single_step())
    assert [path.name for path in paths] == ["overview.png", "error.png"]


@pytest.mark.parametrize("form", ["png", "svg", pytest.param("pdf", marks=pytest.mark.slow)])
def test_the_same_run_gives_the_same_picture(form: str, tmp_path: Path) -> None:
    (first,), (second,) = (write(tmp_path / "made" / each, ["edges"], single_step(), form) for each in "ab")
    assert first.name == second.name == f"edges.{form}"
    assert first.read_bytes() == second.read_bytes()
    if form == "png":
        assert pixels(first)[0] == PIXELS


def test_a_picture_is_laid_out_as_matplotlib_lays_it_out_itself(tmp_path: Path) -> None:
    """It is laid out before it is saved, so that it is drawn once: the bytes are those of a figure that was not."""
    saved = []
    for prepare in (save_figure, lambda figure, path, _: figure.savefig(path, dpi=DOTS_PER_INCH, metadata={})):
        figure = Figure(layout="constrained")
        figure.subplots().set_ylabel("height")
        plain_texts(figure)
        prepare(figure, tmp_path / "picture.png", {})
        saved.append((tmp_path / "picture.png").read_bytes())
    assert saved[0] == saved[1]


def moment(comparison: Comparison, intervals: int, view: PlotView = DEFAULT_VIEW) -> PlotMoment:
    return ShownRun(comparison, {}, view).moment(intervals)


class TestTheView:
    def test_is_where_steps_are_fastest(self) -> None:
        """The sine is fastest at its zeros: 60 mm/s at 80 steps/mm."""
        shown = moment(swinging(), 12)
        assert min(abs(shown.at_s - zero) for zero in (0.0, np.pi / 3)) < 0.01
        assert shown.span_s == pytest.approx(12 / 4800, rel=1e-2)
        assert moment(swinging(), 12, PlotView(span_s=0.25)) == PlotMoment(shown.at_s, 0.25)

    def test_is_the_whole_motion_without_steps(self) -> None:
        assert moment(standing(), 12) == moment(standing(), 160, PlotView(0.5)) == PlotMoment(0.5, 1.0)

    @pytest.mark.parametrize("at_s", [None, 0.3, 1.0, 2.0])
    def test_depends_on_pulses_even_if_no_driver_counts_them(self, at_s: float | None) -> None:
        assert moment(unheard(), 12, PlotView(at_s)) == moment(swinging(), 12, PlotView(at_s))

    def test_shows_some_steps_of_the_axis_that_is_fastest_there(self) -> None:
        """At 0.52 s the trapezoid moves at 33.3 mm/s and 40 steps/mm; the sine is nearly at rest."""
        shown = moment(swinging(), 12, PlotView(np.pi / 6))
        assert shown.span_s == pytest.approx(12 * 1.5 / 50 / 40, rel=0.1)
        assert (shown.from_s + shown.to_s) / 2 == pytest.approx(np.pi / 6)

    @pytest.mark.parametrize("at_s", [0.0, 2.0])
    def test_may_be_at_an_end_and_is_never_longer_than_the_motion(self, at_s: float) -> None:
        assert (
            0 < moment(swinging(), 12, PlotView(at_s)).span_s < moment(swinging(), 10**6, PlotView(at_s)).span_s == 2.0
        )


def drawn_marks(figure: Figure, marker: str) -> FloatArray:
    (axes,) = figure.axes
    return np.concatenate([np.asarray(line.get_xdata()) for line in axes.lines if line.get_marker() == marker])


class TestTheEdges:
    def test_step_and_dir_of_each_axis_have_a_lane(self) -> None:
        (axes,) = draw("edges", swinging(), VIEW).axes
        lanes = [label.get_text() for label in axes.get_yticklabels()]
        assert lanes == ["a STEP", "a DIR", "b STEP", "b DIR", "c STEP", "c DIR"]

    def test_other_pins_have_a_lane_if_they_change(self) -> None:
        """ENABLE and RESET go up 25 ms before the motion."""
        (axes,) = draw("edges", swinging(), PlotView(0.0, 0.06)).axes
        assert [label.get_text() for label in axes.get_yticklabels()][:4] == ["a STEP", "a DIR", "a ENABLE", "a RESET"]

    def test_a_lane_goes_up_and_down_with_its_pin(self) -> None:
        comparison = swinging()
        figure = draw("edges", comparison, VIEW)
        counts = comparison.evidence.axes[0].clk_rise_counts
        t_ms = 1e3 * ((counts - comparison.evidence.start_counts) / 72e6 - 1.0)
        expected = t_ms[np.abs(t_ms) <= 25.0]
        times, levels = (np.asarray(data) for data in figure.axes[0].lines[0].get_data())
        np.testing.assert_allclose(times[1:-1][np.diff(levels)[:-1] > 0], expected, atol=1e-9)

    def test_steps_are_marked_by_their_direction(self) -> None:
        """Around 1.047 s the sine goes down; b steps down all the time."""
        comparison = swinging()
        figure = draw("edges", comparison, PlotView(np.pi / 3, 0.01))
        inside = [np.count_nonzero(np.abs(axis.time_s - np.pi / 3) < 0.005) for axis in comparison.counted]
        assert len(drawn_marks(figure, "v")) == sum(inside) > 40
        assert len(drawn_marks(figure, "^")) == 0
        assert figure.texts[-1].get_text() == "triangles: steps that the driver counted, up or down"

    def test_steps_are_marked_at_their_edges_whatever_the_motions_speed(self) -> None:
        """Half as fast from the start on: edges are shown by the clock, and so are the steps."""
        comparison = swinging()
        start = comparison.evidence.start_counts
        half = RateRamps(*np.array([(start, 65_536, 32_768, 0)], np.int64).T)
        axes = tuple(replace(axis, rates=half) for axis in comparison.evidence.axes)
        slow = compare(comparison.expected, replace(comparison.evidence, axes=axes))
        assert slow.counted[0].time_s == pytest.approx(comparison.counted[0].time_s / 2)
        view = PlotView(np.pi / 3, 0.01)
        as_planned, slower = (drawn_marks(draw("edges", each, view), "v") for each in (comparison, slow))
        assert as_planned.size > 40
        assert np.array_equal(as_planned, slower)

    def test_steps_too_dense_for_marks_have_none(self) -> None:
        """Where the sine turns around, b makes more than 200 steps and a does not."""
        figure = draw("edges", swinging(), PlotView(np.pi / 6, 0.18))
        a, b = (np.count_nonzero(np.abs(axis.time_s - np.pi / 6) < 0.09) for axis in swinging().counted[:2])
        assert len(drawn_marks(figure, "^")) + len(drawn_marks(figure, "v")) == a < 200 < b
        said = figure.texts[-1].get_text()
        assert said == "triangles: steps that the driver counted, up or down, where at most 200"

    @pytest.mark.parametrize(
        ("run", "view", "said"),
        [
            ("dense", PlotView(1.0, 1.0), "steps are too many to be marked, above 200 an axis"),
            ("unheard", PlotView(1.0, 0.01), "no driver counted a step here"),
        ],
    )
    def test_the_label_says_why_there_are_no_marks(self, run: str, view: PlotView, said: str) -> None:
        figure = draw("edges", RUNS[run](), view)
        (axes,) = figure.axes
        assert figure.texts[-1].get_text() == said
        assert not any(np.asarray(drawn.get_xdata()).size for drawn in axes.lines if drawn.get_marker() in ("^", "v"))

    @pytest.mark.parametrize("run", ["swinging", "unheard"])
    def test_intervals_are_those_of_the_pulses(self, run: str) -> None:
        """At 1 s b moves at 33.3 mm/s and 40 steps/mm; c stands still."""
        (axes,) = draw("edges", RUNS[run](), PlotView(1.0, 0.01)).axes
        *said, heading = [text.get_text() for text in axes.texts]
        assert heading == "STEP interval at 0"
        assert len(said) == 2
        assert float(said[1].removesuffix(" us")) == pytest.approx(750, abs=0.02)

    @pytest.mark.parametrize(("run", "at_s"), [("swinging", 0.0), ("standing", 0.5)])
    def test_without_intervals_there_is_no_heading_for_them(self, run: str, at_s: float) -> None:
        (axes,) = draw("edges", RUNS[run](), PlotView(at_s, 0.01)).axes
        assert not axes.texts

    def test_a_single_count_has_lanes_too(self) -> None:
        (axes,) = draw("edges", swinging(), PlotView(1.0, 1 / 72e6)).axes
        first, last = axes.get_xlim()
        for lane in axes.lines[:6]:
            times = np.asarray(lane.get_xdata())
            assert times[0] <= first < last <= times[-1]


class TestTheTiming:
    def rows(self, late_us: float) -> list[Axes]:
        """Return the rows of axis a, exact to a count of the timer, and b, evenly up to `late_us` early and late."""
        comparison = swinging()
        steps = comparison.evidence.axes[1].step_counts
        spread = np.rint(72 * late_us * np.linspace(-1.0, 1.0, steps.size)).astype(np.int64)
        evidence = altered(comparison.evidence, 1, step_counts=np.sort(steps + spread))
        return draw("timing", compare(comparison.expected, evidence), VIEW).axes

    def bars(self, row: Axes) -> tuple[FloatArray, FloatArray]:
        """Return the number of edges in each bar of a row, and the borders of the bars."""
        (histogram,) = (patch for patch in row.patches if isinstance(patch, StepPatch))
        return histogram.get_data()[:2]

    @pytest.mark.parametrize("late_us", [0.0, 1.0, 150.0])
    def test_fast_axes_keep_their_shape_beside_slow_ones(self, late_us: float) -> None:
        """Errors of half a count at most are in the linear part, whatever the other axis does."""
        first, second = self.rows(late_us)
        edges, borders_us = self.bars(first)
        full = np.flatnonzero(edges)
        assert full.size >= 8
        assert (np.abs(borders_us[[full, full + 1]]) <= 1 / 72).all()
        assert first.get_xscale() == second.get_xscale() == "symlog"
        assert first.get_xlim() == second.get_xlim()

    @pytest.mark.parametrize("late_us", [0.0, 1.0, 150.0])
    def test_every_edge_is_in_a_bar(self, late_us: float) -> None:
        for row in self.rows(late_us):
            assert self.bars(row)[0].sum() == int(row.get_title(loc="right").split()[0]) > 1000

    def test_the_label_names_the_scale(self) -> None:
        label = self.rows(1.0)[-1].get_xlabel()
        assert "linear within one count of the board's timer, +-0.014 us, logarithmic beyond" in label


@pytest.mark.slow
def test_jitter_is_the_interval_minus_the_ideal_interval() -> None:
    """A step that is 5 us late makes the interval before it 5 us longer and the interval after it 5 us shorter."""
    comparison = dense()
    late = comparison.evidence.axes[0].step_counts.copy()
    late[5000] += 360
    comparison = compare(comparison.expected, altered(comparison.evidence, step_counts=late))
    left, right = draw("jitter", comparison, VIEW).axes[:2]
    jitter_us = np.asarray(left.lines[0].get_ydata())
    assert sorted(jitter_us[np.abs(jitter_us) > 1]) == pytest.approx([-5, 5], abs=0.03)
    assert "max 5" in left.get_title(loc="right")
    assert right.get_ylim() == left.get_ylim()


def test_thinning_keeps_the_extremes_of_every_group() -> None:
    t_s = np.arange(100_003, dtype=np.float64)
    values = np.random.default_rng(2).normal(size=t_s.size)
    values[12_345] = 50.0
    values[-1] = -50.0
    thin_s, thin = thinned(t_s, values, groups=500)
    assert len(thin) <= 2 * 500 + 500
    assert (thin.max(), thin.min()) == (50.0, -50.0)
    assert (np.diff(thin_s) > 0).all()
    np.testing.assert_array_equal(values[thin_s.astype(int)], thin)


def test_an_envelope_has_the_extremes_of_each_column_and_of_its_neighbours() -> None:
    """Of 2000 instants in 640 columns; the value between two columns is in both, and so are those at the ends."""
    t_s, values = np.linspace(0.0, 1.0, 2000), np.random.default_rng(3).normal(size=(2, 2000))
    middle_s, lows, highs = envelope(t_s, values, 1.0)
    half_s = middle_s[0]
    for at_s, low, high in zip(middle_s, lows, highs, strict=True):
        first = max(int(np.searchsorted(t_s, at_s - half_s)) - 1, 0)
        last = min(int(np.searchsorted(t_s, at_s + half_s, side="right")), 1999)
        assert (low, high) == (values[:, first : last + 1].min(), values[:, first : last + 1].max())


def test_short_series_are_not_thinned() -> None:
    t_s = np.linspace(0.0, 1.0, 100)
    assert thinned(t_s, t_s)[0] is t_s


@pytest.mark.slow
def test_widths_are_shown_with_their_distance_from_the_limits() -> None:
    """CLK is high for 33 us, 3 us above the limit, and low for 217 us, 5 us less than the limit."""
    limits = (DriverLimit("clk_high", "", 30.0, "us", ""), DriverLimit("clk_low", "", 222.0, "us", ""))
    evidence = altered(steady().evidence, violations=replace(NO_VIOLATIONS, limits=limits))
    first, second = draw("widths", compare(steady().expected, evidence), VIEW).axes
    assert first.get_title(loc="right") == (
        "high >= 33.00 us, 3.00 above its limit; low >= 217.00 us, 5.00 below its limit; rise to rise >= 250.00 us"
    )
    drawn = [float(np.asarray(line.get_xdata())[0]) for line in first.lines]
    assert drawn == [30.0, 222.0]
    assert not second.lines
    assert second.get_xlabel() == "duration [us]; a driver's CLK rises where the board's STEP rises"


@pytest.mark.slow
def test_widths_and_limits_are_those_of_clk() -> None:
    """If the falling edge is active, CLK is low while STEP is high, for 33 us."""
    limits = (DriverLimit("clk_high", "", 30.0, "us", ""), DriverLimit("clk_low", "", 150.0, "us", ""))
    evidence = steady().evidence
    for axis in range(2):
        evidence = altered(
            evidence, axis, active_edge=ActiveEdge.FALLING, violations=replace(NO_VIOLATIONS, limits=limits)
        )
    first, second = draw("widths", compare(steady().expected, evidence), VIEW).axes
    assert first.get_title(loc="right").startswith(
        "high >= 217.00 us, 187.00 above its limit; low >= 33.00 us, 117.00 below its limit; "
    )
    assert second.get_xlabel() == "duration [us]; a driver's CLK rises where the board's STEP falls"


def test_the_strictest_of_several_limits_counts() -> None:
    """Module and chip set limits; every pulse lasts the one count that a module without delays of its own needs."""
    limits = [("clk_high", 1 / 72), ("clk_low", 1 / 72), ("clk_high", 30.0), ("clk_period", 66.0), ("clk_high", 20.0)]
    violations = replace(NO_VIOLATIONS, limits=tuple(DriverLimit(rule, "", us, "us", "") for rule, us in limits))
    evidence = altered(steady().evidence, violations=violations)
    first, _ = draw("widths", compare(steady().expected, evidence), VIEW).axes
    assert [float(np.asarray(line.get_xdata())[0]) for line in first.lines] == [30.0, 66.0]
    assert [text.get_text() for text in first.texts] == ["high 30 ", "rise to rise 66 "]
    assert first.get_title(loc="right").count("its limit") == 2
    assert first.get_xlim()[0] > 20


@pytest.mark.slow
def test_limits_near_to_each_other_share_a_label() -> None:
    limits = [("clk_high", 150.0), ("clk_low", 151.0), ("clk_period", 310.0)]
    violations = replace(NO_VIOLATIONS, limits=tuple(DriverLimit(rule, "", us, "us", "") for rule, us in limits))
    evidence = altered(steady().evidence, violations=violations)
    first, _ = draw("widths", compare(steady().expected, evidence), VIEW).axes
    assert [text.get_text() for text in first.texts] == ["high 150 \nlow 151 ", "rise to rise 310 "]
    assert len(first.lines) == 3


def test_limits_without_a_least_duration_of_clk_are_not_drawn() -> None:
    limits = (DriverLimit("clk_low", "", -4.0, "us", ""), DriverLimit("mode_change", "", 0.0, "level", ""))
    evidence = altered(steady().evidence, violations=replace(NO_VIOLATIONS, limits=limits))
    first, _ = draw("widths", compare(steady().expected, evidence), VIEW).axes
    assert not first.lines


class TestThePhases:
    """The field turns once a second in sixteen steps, from 1 s on."""

    def figure(self, view: PlotView) -> Figure:
        sixteenths = np.arange(0, 64, 4)
        angle = 2 * np.pi * sixteenths / 64
        a_ma, b_ma = (np.rint(1500 * wave).astype(np.int16) for wave in (np.cos(angle), np.sin(angle)))
        counts = START_COUNTS + 72_000_000 + np.arange(16) * 4_500_000
        phases = Phases(counts, sixteenths.astype(np.int32), a_ma, b_ma)
        comparison = swinging()
        return draw("phases", compare(comparison.expected, altered(comparison.evidence, phases=phases)), view)

    def test_are_a_circle(self) -> None:
        field = self.figure(PlotView()).axes[0]
        a, b = (np.asarray(values, np.float64) for values in field.lines[0].get_data())
        assert len(a) == 16
        np.testing.assert_allclose(np.hypot(a, b), 1.5, atol=0.001)
        assert field.get_xlim() == field.get_ylim() == (-1.15 * 1.5, 1.15 * 1.5)

    def test_hold_from_step_to_step(self) -> None:
        """The view from 1.48 to 1.52 s holds one step, at 1.5 s, to half a turn; before it the value holds."""
        over_time = self.figure(PlotView(1.5, 0.04)).axes[1]
        a, b = over_time.lines[:2]
        assert (a.get_label(), b.get_label()) == ("phase A", "phase B")
        assert np.asarray(a.get_xdata()).tolist() == pytest.approx([-20.0, 0.0, 20.0], abs=1e-6)
        assert np.asarray(a.get_ydata()).tolist() == [-1.386, -1.5, -1.5]
        assert np.asarray(b.get_ydata()).tolist() == [0.574, 0.0, 0.0]

    def test_begin_at_power_up(self) -> None:
        """Half of the span lies before the motion, but the record begins at count 0."""
        assert self.figure(PlotView(0.5, 1.0)).axes[1].get_xlim() == pytest.approx((-500.0, 500.0))
        power_up_ms = -1e3 * START_COUNTS / 72e6
        assert self.figure(PlotView(0.0, 1.0)).axes[1].get_xlim() == pytest.approx((power_up_ms, 500.0))

    def test_of_a_driver_without_current_are_zero(self) -> None:
        field, over_time = self.figure(PlotView()).axes[2:4]
        assert np.asarray(field.lines[0].get_xdata()).size == 0
        assert field.get_ylabel() == "b [A]"
        assert np.asarray(over_time.lines[0].get_ydata()).tolist() == [0.0]


@pytest.mark.parametrize(
    ("robot", "job"),
    [("$x^$", "$\\frac{$"), ("\ud800", "\x1b[31m"), ("直", "x" * 100_000)],
    ids=["formulas", "signs", "long"],
)
def test_a_name_is_drawn_as_it_is(robot: str, job: str, tmp_path: Path) -> None:
    """Neither as a formula nor as a control character, and a long one only in part."""
    run = replace(RUN, robot=robot, job=job)
    write_plots(tmp_path, ["edges"], run, single_step(), {}, "svg")
    assert (tmp_path / "edges.svg").stat().st_size < 200_000


@pytest.mark.slow
def test_only_labels_at_axes_are_formulas(tmp_path: Path) -> None:
    """Powers of ten are formulas; the texts with names are not."""
    with mpl.rc_context(SHEET_STYLE):
        figure = draw("timing", single_step(), VIEW)
        save_figure(figure, tmp_path / "timing.svg", {})
    labels = {label for tick in figure.findobj(Tick) for label in (tick.label1, tick.label2)}
    assert any(label.get_text().startswith(r"$\mathdefault{10^") for label in labels)
    assert all(label.get_parse_math() for label in labels)
    others = [text for text in figure.findobj(Text) if text not in labels]
    assert any(RUN.robot in text.get_text() for text in others)
    assert not any(text.get_parse_math() for text in others)
