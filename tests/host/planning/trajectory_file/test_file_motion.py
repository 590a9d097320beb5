"""Interpolations and ramps of files, and what a refusal says of the points: each value that passes, by planning it."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.composer import Sequence, Standstill
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.trajectory_file import FileMotion, PointCurve, doubt, read_file_motion, read_trajectory
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
HEADER = "t,th1,th2,d3,th4"
CSV = f"{HEADER}\n0,0,10,0,0\n1,-15,40,10,-20\n2,-30,86.2,0.5,-56\n"
TIMES_S = np.array([0.0, 1.0, 2.0])
MOVING = f"{HEADER},v_th1,v_th2,v_d3,v_th4\n0,0,10,10,0,60,0,0,0\n1,50,10,10,0,30,0,0,0\n"


def read(folder: Path, text: str, interpolate: str | None = None, ramps_s: float = 0.0) -> FileMotion:
    file = folder / "points.csv"
    file.write_text(text, encoding="utf-8")
    return read_file_motion(str(file), ROBOT, interpolate=interpolate, ramps_s=ramps_s)


def refusal(motion: FileMotion, stretch: float | None = None) -> str:
    """Return the error with which a motion is refused."""

    def planned() -> None:
        with motion.explained(stretch or 1.0):
            plan_stretched(ROBOT, motion.whole, stretch) if stretch else plan(ROBOT, motion.whole)

    return complaint_of(planned)


def test_stop_rests_at_each_point_and_keeps_the_lines(tmp_path: Path) -> None:
    motion = read(tmp_path, CSV, "stop")
    assert motion.interpolation is PointCurve.STOP
    assert np.abs(motion.whole.velocities(TIMES_S)).max() < 1e-9
    assert motion.whole.velocities(np.array([0.5]))[0] == pytest.approx([-22.5, 45, 15, -30])  # 1.5 times the mean
    assert max(departure.distance for departure in motion.departures()) < 1e-9


def test_linear_keeps_its_speed_and_misses_the_points_by_its_blends(tmp_path: Path) -> None:
    motion = read(tmp_path, CSV, "linear")
    speeds = motion.whole.velocities(np.array([0.4, 0.5, 0.6]))
    assert np.ptp(speeds, axis=0) == pytest.approx(0.0, abs=1e-9)
    sizes = {departure.what: departure.distance for departure in motion.departures()}
    assert 0.0 < sizes["d3"] == pytest.approx(abs(motion.whole.positions(TIMES_S)[1, 2] - 10.0))
    assert refused_by_nobody(motion)


def refused_by_nobody(motion: FileMotion) -> bool:
    plan(ROBOT, motion.whole)
    return True


def test_spline_is_the_default(tmp_path: Path) -> None:
    spline, default = read(tmp_path, CSV, "spline"), read(tmp_path, CSV)
    t_s = np.linspace(0.0, 2.0, 101)
    assert np.array_equal(spline.whole.positions(t_s), default.whole.positions(t_s))
    assert default.interpolation is PointCurve.SPLINE
    path = str(tmp_path / "points.csv")
    assert np.array_equal(read_trajectory(path, ROBOT).positions(t_s), default.whole.positions(t_s))


def test_points_stand_still_where_they_repeat_in_every_interpolation(tmp_path: Path) -> None:
    text = f"{HEADER}\n0,0,10,0,0\n1,9,20,10,0\n1.5,9,20,10,0\n2.5,0,10,10,5\n"
    for interpolate in PointCurve:
        motion = read(tmp_path, text, interpolate).whole
        still = motion.velocities(np.linspace(1.0, 1.5, 51))
        assert np.abs(still).max() < 1e-9, interpolate


def test_ramps_around_a_file_with_a_pause(tmp_path: Path) -> None:
    text = f"{HEADER}\n0,0,10,10,0\n1,9,20,10,0\n1.5,9,20,10,0\n2.5,0,10,10,5\n"
    for interpolate in ("spline", "linear"):
        motion = read(tmp_path, text, interpolate, 0.1)
        assert motion.whole.duration_s == 2.7
        inner = motion.through
        parts = law_of(inner, Sequence).parts
        assert [type(part.law) is Standstill for part in parts] == [False, True, False]
        assert np.abs(inner.velocities(np.array([0.0, 2.5]))).max(axis=1).min() > 5.0
        assert np.abs(inner.velocities(np.array([1.0, 1.25, 1.5]))).max() < 1e-9
        plan(ROBOT, motion.whole)


@pytest.mark.parametrize(
    ("text", "interpolate", "ramps_s", "told"),
    [
        (CSV, "splin", 0.0, "interpolate: 'splin' is unknown: did you mean spline?"),
        (
            MOVING,
            "linear",
            0.0,
            "interpolate=linear: the file gives velocities, and with them the motion between its points",
        ),
        (CSV, "stop", 0.1, "ramps_s=0.1: a motion that stops at each point starts and ends at rest"),
        (CSV, None, 0.0004, "ramps_s=0.0004: 0.0004 s is not a whole number of milliseconds"),
        (CSV, None, -0.5, "ramps_s=-0.5: is not above 0 s"),
        (
            MOVING.replace("60,0,0,0", "0,0,0,0").replace("30,0,0,0", "0,0,0,0"),
            None,
            0.1,
            "ramps_s=0.1: the motion starts and ends at rest",
        ),
        (CSV.replace("\n1,", "\n1.0004,"), "linear", 0.0, "line 3, t: 1.0004 s is not a whole number of milliseconds"),
        (CSV.replace("\n1,", "\n1.0004,"), "stop", 0.0, "line 3, t: 1.0004 s is not a whole number of milliseconds"),
    ],
)  # fmt: skip
def test_refused(text: str, interpolate: str | None, ramps_s: float, told: str, tmp_path: Path) -> None:
    message = complaint_of(lambda: read(tmp_path, text, interpolate, ramps_s))
    assert message.removeprefix(f"{tmp_path}/points.csv: ").startswith(told)


class TestALimitThatOnlyTheSplineExceeds:
    def test_of_position(self, tmp_path: Path) -> None:
        text = f"{HEADER}\n0,0,10,59,0\n1,0,10,5,0\n2,0,10,60,0\n3,0,10,59,0\n"
        told = refusal(read(tmp_path, text))
        assert told.startswith("d3: 60.0")
        assert told.endswith("; the points themselves stay within 5..60 mm (interpolate=linear does too)")
        slower = text.replace("\n1,", "\n4,").replace("\n2,", "\n8,").replace("\n3,", "\n12,")
        assert refused_by_nobody(read(tmp_path, slower, "linear"))
        for wrong in (
            (",60,", ",60.5,"),
            (",59,", ",-1,"),
        ):
            with refusing(InputError):
                read(tmp_path, text.replace(*wrong))

    @pytest.mark.parametrize("stretch", [None, 1.1])
    def test_of_speed(self, stretch: float | None, tmp_path: Path) -> None:
        """720 deg in 2.5 s are 288 deg/s at constant speed, and 432 in the middle of the spline; the limit is 360."""
        text = f"{HEADER}\n0,0,10,0,-360\n2.5,0,10,0,360\n"
        told = refusal(read(tmp_path, text), stretch)
        steady = 288 / (stretch or 1)
        assert told.startswith(f"th4: a speed of {432 / (stretch or 1):.1f} deg/s")
        assert told.endswith(
            f"; only the spline exceeds it, at constant speed from point to point it is {steady:.1f} deg/s"
        )
        assert refused_by_nobody(read(tmp_path, text, "linear"))

    def test_of_the_step_rate(self, tmp_path: Path) -> None:
        """40 mm in 1 s are 12.8 kHz of the driver's 15: the spline needs 19.2."""
        told = refusal(read(tmp_path, f"{HEADER}\n0,0,10,0,0\n1,0,10,40,0\n"))
        assert told.startswith("d3: 19.2 kHz of steps")
        assert told.endswith("; only the spline exceeds it, at constant speed from point to point it is 12800.0 Hz")

    def test_not_of_one_that_the_points_exceed(self, tmp_path: Path) -> None:
        for interpolate in PointCurve:
            told = refusal(read(tmp_path, f"{HEADER}\n0,0,10,0,-360\n1.9,0,10,0,360\n", interpolate))
            assert "passes (stretch=" in told
            assert "only" not in told


class TestRamps:
    """The run-in of 60 deg/s takes 60 / 1000 s."""

    def test_a_file_that_starts_in_motion_is_told_its_ramps(self, tmp_path: Path) -> None:
        limit = ROBOT.joint("th1").acceleration_max
        shortest_s = np.ceil(60_000 / limit) / 1000
        told = refusal(read(tmp_path, MOVING))
        assert told.startswith("th1: the motion starts at t = 0.000 s with 60 deg/s instead of 0 deg/s, at rest")
        assert told.endswith(f"; a run-in and a run-out of {shortest_s:g} s pass (ramps_s={shortest_s:g})")
        assert refused_by_nobody(read(tmp_path, MOVING, ramps_s=shortest_s))
        too_short = refusal(read(tmp_path, MOVING, ramps_s=round(shortest_s - 0.001, 3)))
        assert "acceleration" in too_short
        assert too_short.endswith(f"(ramps_s={shortest_s:g})")

    def test_they_are_not_offered_if_they_do_not_pass(self, tmp_path: Path) -> None:
        """The run-in would begin beyond the limit of th1, or the motion itself is too fast."""
        edge = MOVING.replace("\n0,0,10", "\n0,-130,10").replace("\n1,50", "\n1,-80")
        refusal(read(tmp_path, edge))
        fast = MOVING.replace("\n1,50", "\n1,120")
        assert "ramps" not in refusal(read(tmp_path, fast.replace("60,0,0,0", "600,0,0,0")))

    def test_with_a_stretch(self, tmp_path: Path) -> None:
        told = refusal(read(tmp_path, MOVING), 2.0)
        offered_s = float(told.rpartition("ramps_s=")[2].removesuffix(")"))
        plan_stretched(ROBOT, read(tmp_path, MOVING, ramps_s=offered_s).whole, 2.0)
        with refusing(InputError):
            plan_stretched(ROBOT, read(tmp_path, MOVING, ramps_s=round(offered_s - 0.001, 3)).whole, 2.0)


def test_blends_without_room_are_refused_with_the_stretch_that_passes(tmp_path: Path) -> None:
    text = f"{HEADER}\n0,0,10,0,0\n0.05,1,10,0,0\n0.1,0,10,0,0\n0.15,1,10,0,0\n"
    motion = read(tmp_path, text, "linear")
    told = refusal(motion)
    assert "acceleration" in told
    factor = float(told.partition("(stretch=")[2].partition(")")[0])
    plan_stretched(ROBOT, motion.whole, factor)
    with pytest.raises(InputError):
        plan_stretched(ROBOT, motion.whole, factor - 0.001)


class TestFastest:
    """A file's path in the least time: its points stay, its times do not."""

    def written(self, folder: Path) -> str:
        file = folder / "points.csv"
        file.write_text(CSV, encoding="utf-8")
        return str(file)

    def test_passes_through_the_points_in_less_time(self, tmp_path: Path) -> None:
        path = self.written(tmp_path)
        motion = read_file_motion(path, ROBOT, law="fastest")
        again = read_trajectory(path, ROBOT, law="fastest")
        assert again.duration_s == motion.whole.duration_s < 0.8 * motion.through.duration_s
        plan(ROBOT, again)
        positions = again.positions(np.arange(0.0, again.duration_s, 1e-4))
        for point in motion.points.positions:
            assert np.abs(ROBOT.to_steps(positions - point)).max(axis=1).min() < 1.0

    def test_its_units_are_doubted_by_its_travel(self, tmp_path: Path) -> None:
        file = tmp_path / "points.csv"
        file.write_text(f"{HEADER}\n0,0,0.2,0.01,0\n1,0.3,0.5,0.01,0\n", encoding="utf-8")

        def read_in(units: str) -> FileMotion:
            return read_file_motion(str(file), ROBOT, units=units, law="fastest")

        motion = read_file_motion(str(file), ROBOT, law="fastest")
        assert "units=rad,m fits, too" in str(doubt(motion, plan(ROBOT, motion.whole), read_in))

    def test_ramps_and_other_laws_are_refused(self, tmp_path: Path) -> None:
        path = self.written(tmp_path)
        ramps = complaint_of(lambda: read_trajectory(path, ROBOT, law="fastest", ramps_s=1.0))
        assert "ramps_s=1: law=fastest starts and ends at rest" in ramps
        other = complaint_of(lambda: read_trajectory(path, ROBOT, law="cubic"))
        assert other == "law=cubic: a trajectory file keeps its own times, or has law=fastest"
