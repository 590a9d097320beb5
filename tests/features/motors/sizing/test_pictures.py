"""The pictures of a run's motors: what they draw, without writing files."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from steptwin.features.motors.sizing.motor_pictures import PICTURES
from steptwin.features.motors.turning import MotorRun
from steptwin.host.record.plots import draw_picture
from steptwin.host.robots import load_robot
from steptwin.host.verify import BusReport, Comparison, RunInfo

RUN = RunInfo("teaching-scara", "turn", 1.0, BusReport(1_000_000, 0, 0.0), 1.0, 1.0)


def draw(name: str, ran: MotorRun) -> Figure:
    return draw_picture(PICTURES[name], RUN, ran)


def texts(figure: Figure) -> str:
    return "\n".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_the_load_angle_is_drawn_for_each_joint_with_its_limit_and_its_slip(ran: MotorRun) -> None:
    at_counts = ran.driving.start_counts + 36_000_000
    slipped = replace(ran, trace=replace(ran.trace, first_slip_counts=(at_counts, None, None, None)))
    figure = draw("motor-load", slipped)
    assert [axes.get_ylabel() for axes in figure.axes] == ["th1 [deg]", "th2 [deg]", "d3 [deg]", "th4 [deg]"]
    assert texts(figure).endswith("\nslips at 0.500 s")
    assert "slips" not in texts(draw("motor-load", ran))
    drawn, *limits = figure.axes[0].get_lines()
    assert np.abs(np.asarray(drawn.get_ydata())).max() == pytest.approx(abs(ran.verdict.joints[0].load_angle_deg))
    assert [float(np.asarray(line.get_ydata())[0]) for line in limits[:2]] == [-90.0, 90.0]


def test_a_second_motor_has_a_row_of_its_own(ran: MotorRun) -> None:
    thor = load_robot("thor")
    load_deg = np.repeat(ran.trace.load_deg[:, :1], 7, axis=1)
    load_deg[:, 6] = 45.0
    trace = replace(ran.trace, load_deg=load_deg, first_slip_counts=(None,) * 7)
    figure = draw("motor-load", replace(ran, driving=replace(ran.driving, robot=thor), trace=trace))
    assert [axes.get_ylabel() for axes in figure.axes] == [*(f"J{i} [deg]" for i in range(1, 7)), "J2b [deg]"]
    assert np.asarray(figure.axes[6].get_lines()[0].get_ydata()).max() == 45.0


def test_the_motions_points_are_drawn_into_the_pull_out_curve(ran: MotorRun) -> None:
    axes = draw("motor-torque", ran).axes[0]
    curve, less, needed, least = axes.get_lines()
    np.testing.assert_allclose(np.asarray(less.get_ydata()), 0.7 * np.asarray(curve.get_ydata()))
    assert len(np.asarray(needed.get_xdata())) == len(ran.torques.t_s)
    worst = ran.verdict.joints[0]
    assert (*np.asarray(least.get_xdata()), *np.asarray(least.get_ydata())) == (
        worst.margin_rpm,
        worst.torque_needed_nm,
    )
    assert axes.get_title(loc="left") == f"th1: 17HS19-2004S1, {100 * worst.margin:.0f} % left"


def test_the_tool_is_drawn_where_it_is_planned_counted_and_reached(ran: MotorRun, comparison: Comparison) -> None:
    path, distance, attitude = draw("motor-tool", ran).axes
    assert [line.get_label() for line in path.get_lines()] == ["planned", "counted", "really reached", "start"]
    counted, reached = (np.asarray(line.get_ydata()) for line in distance.get_lines())
    assert counted.max() < reached.max()
    apart = np.linalg.norm(ran.paths.reached[:, :3] - ran.paths.planned[:, :3], axis=1)
    assert reached.max() == pytest.approx(apart.max())
    assert len(attitude.get_lines()) == 2
    assert comparison.expected.motion.duration_s < path.figure.axes[1].get_xlim()[1]
