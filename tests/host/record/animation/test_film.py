"""Cameras and films: directions, frames, speeds, what pictures must hold, and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.record.animation import CAMERAS, Camera, Shot, make_film
from steptwin.host.record.animation.film import FRAMES_MAX, USUAL_LENGTH_S, PulseRow
from steptwin.host.record.recorded_machine import RecordedMachine
from tests.host.record.machines import perfect_run
from tests.messages import refusing

RUN = perfect_run("teaching-scara", "carry")
STORE = perfect_run("warehouse-scara", "store")


@pytest.mark.parametrize(
    ("name", "right", "up"),
    [("top", (1, 0, 0), (0, 1, 0)), ("front", (1, 0, 0), (0, 0, 1)), ("side", (0, 1, 0), (0, 0, 1))],
)
def test_what_cameras_see_to_the_right_and_upwards(
    name: str, right: tuple[int, int, int], up: tuple[int, int, int]
) -> None:
    seen = Camera.named(name).seen(np.array([right, up], np.float64))
    assert seen[:, :2] == pytest.approx(np.eye(2), abs=1e-12)


@pytest.mark.parametrize("text", [*CAMERAS, "0,0", "-170.5,-90", "1e2,45"])
def test_a_camera_keeps_lengths_and_sees_from_its_own_direction(text: str) -> None:
    camera = Camera.named(text)
    assert camera.basis @ camera.basis.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(camera.basis) == pytest.approx(1.0)
    azimuth, elevation = np.deg2rad([camera.azimuth_deg, camera.elevation_deg])
    towards = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    assert camera.seen(np.array(towards)) == pytest.approx([0, 0, 1], abs=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "isometric",
        "1,2,3",
        "0,90.1",
        "nan,0",
        "0,x",
    ],
)
def test_other_cameras_are_refused(text: str) -> None:
    with refusing(InputError):
        Camera.named(text)


@pytest.mark.slow
def test_a_film_shows_the_counted_machine() -> None:
    film = make_film(RUN)
    machine = RecordedMachine.of(RUN)
    assert film.title == "teaching-scara · carry (SIMULATED)"
    assert (film.times_s[0], film.times_s[-1], film.speed) == (0.0, 1.0, 0.1)
    assert len(film.times_s) == 201
    for part, expected in zip(film.parts, machine.links(film.times_s), strict=True):
        np.testing.assert_array_equal(part.points_mm, expected.points_mm)
    assert [part.role for part in film.marks] == ["axis"] * 4
    with_frames = make_film(RUN, Shot(frames=True))
    assert [part.name for part in with_frames.marks[-3:]] == ["x of tool", "y of tool", "z of tool"]
    assert with_frames.marks[-1].points_mm[:, 0] == pytest.approx(machine.counted_poses(film.times_s)[:, :3], abs=1e-9)
    assert with_frames.extent_mm() == pytest.approx(film.extent_mm())
    assert film.gain == film.path.gain > 1.0
    assert (np.diff(film.path_until) > 0).all()
    assert film.path_until[-1] == len(film.path.planned_mm)
    tips_mm = machine.counted_poses(film.times_s)[:, :3]
    assert film.path.counted_mm()[film.path_until - 1] == pytest.approx(tips_mm, abs=0.2)


@pytest.mark.parametrize(
    ("shot", "first_s", "last_s", "frames"),
    [
        (Shot(speed=1.0), 0.0, 1.0, 21),
        (Shot(speed=1.0, fps=30.0, from_s=0.25, to_s=0.75), 0.25, 0.75, 16),
        (Shot(speed=3.0), 0.0, 1.0, 8),
        (Shot(to_s=0.0), 0.0, 0.0, 1),
    ],
)
def test_frames_go_from_the_first_to_the_last_time(shot: Shot, first_s: float, last_s: float, frames: int) -> None:
    film = make_film(RUN, shot)
    assert len(film.times_s) == frames
    assert (film.times_s[0], film.times_s[-1]) == (first_s, last_s)
    steps_s = np.diff(film.times_s)
    assert steps_s[:-1] == pytest.approx(np.full(max(frames - 2, 0), film.speed / film.fps))
    assert (steps_s > 0).all()


def test_the_usual_speed_is_the_slowest_round_one_that_is_short() -> None:
    film = make_film(STORE)
    duration_s = STORE.duration_s
    assert film.speed == 5.0
    assert duration_s / 5.0 <= USUAL_LENGTH_S < duration_s / 2.0


@pytest.mark.parametrize(
    ("shot", "words"),
    [
        (Shot(fps=0.5), "fps=0.5 is outside 1..100 frames a second"),
        (Shot(fps=float("nan")), "fps=nan is outside"),
        (Shot(speed=0.0), "speed=0 is not above 0"),
        (Shot(speed=float("inf")), "speed=inf is not above 0"),
        (Shot(speed=0.003), f"speed=0.003 makes 6.67e+03 frames, more than {FRAMES_MAX}: speed=0.00333334 would do"),
        (Shot(from_s=-0.1), "from_s=-0.1 s: the motion goes from 0 to 1 s"),
        (Shot(to_s=1.1), "to_s=1.1 s: the motion goes from 0 to 1 s"),
        (Shot(from_s=0.5, to_s=0.5), "from_s=0.5 s is not before 0.5 s"),
        (Shot(gain=0.5), "gain=0.5 is outside 1..1e9"),
        (Shot(gain=float("nan")), "gain=nan is outside"),
    ],
)
def test_a_shot_that_makes_no_film_is_refused(shot: Shot, words: str) -> None:
    with pytest.raises(InputError) as error:
        make_film(RUN, shot)
    assert str(error.value).startswith(words)


def test_the_slowest_speed_that_is_named_passes() -> None:
    assert len(make_film(RUN, Shot(speed=0.00333334)).times_s) <= FRAMES_MAX + 1


def test_pictures_hold_what_moves_but_no_long_rail() -> None:
    film = make_film(STORE)
    extent_mm = film.extent_mm()
    low_mm, high_mm = extent_mm.min(axis=0), extent_mm.max(axis=0)
    rail = next(part for part in film.parts if part.name == "rail sx").points_mm
    assert rail.max() == 2000.0 > high_mm[0] > 1175.0 - 1e-6  # the shelf is shown because one of its drawers moves
    assert low_mm[1] <= -234.0
    for part in film.parts:
        if part.role not in {"guide"}:
            points_mm = part.points_mm.reshape(-1, 3)
            assert (points_mm >= low_mm - 1e-9).all()
            assert (points_mm <= high_mm + 1e-9).all()
    moved = next(box for box in film.boxes if box.name == "drawer-A1")
    assert moved.moves
    assert (moved.edges_mm + moved.shifts_mm[:, None, None]).min() >= low_mm.min()
    assert 50.0 <= film.grid_mm <= 200.0


def test_a_mechanism_that_its_counts_pull_apart_leaves_a_film_of_the_rest() -> None:
    """The hybrid arm's sliders cannot be further apart than its links allow; lost steps can count them so far."""
    helix = perfect_run("hybrid-arm", "five-points")
    counted = list(helix.comparison.counted)
    z5 = counted[1]
    counted[1] = replace(z5, positions=z5.positions + np.where(np.arange(len(z5.positions)) > 5000, 2e5, 0.0))
    film = make_film(replace(helix, comparison=replace(helix.comparison, counted=tuple(counted))), Shot(fps=2.0))
    assert np.isnan(film.parts[-1].points_mm).any()
    assert np.isfinite(film.extent_mm()).all()
    assert np.isfinite(film.grid_mm)


def test_the_line_of_a_pin_in_a_window() -> None:
    """Each pulse has its four corners; those at the window's ends are cut off there."""
    row = PulseRow("th1", np.array([0.1, 0.3, 0.5]), np.array([0.2, 0.4, 0.6]))
    line = row.levels(0.15, 0.35)
    assert line[:, 0] == pytest.approx([-0.2, -0.2, -0.2, -0.15, -0.15, -0.05, -0.05, 0.0, 0.0, 0.0])
    assert line[:, 1].tolist() == [0, 0, 1, 1, 0, 0, 1, 1, 0, 0]
    assert row.levels(0.7, 0.8) == pytest.approx(np.array([[-0.1, 0.0], [0.0, 0.0]]))


def test_a_film_has_the_pulses_of_every_driver() -> None:
    film = make_film(RUN, Shot(pulses_ms=5.0))
    evidence = RUN.comparison.evidence
    for row, axis in zip(film.pulses, evidence.axes, strict=True):
        assert row.name == axis.name
        assert len(row.rises_s) == len(row.falls_s) == axis.clk_fall_counts.size
        assert row.rises_s * 72e6 + evidence.start_counts == pytest.approx(axis.clk_rise_counts[: len(row.rises_s)])
        assert (row.rises_s < row.falls_s).all()
    assert make_film(RUN).pulses == ()


@pytest.mark.parametrize("pulses_ms", [0.0, -1.0, 1000.1, float("nan")])
def test_windows_of_pulses_are_bounded(pulses_ms: float) -> None:
    with refusing(InputError):
        make_film(RUN, Shot(pulses_ms=pulses_ms))
