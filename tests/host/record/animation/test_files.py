"""The files of animations: a GIF that pillow reads, a video as ffmpeg gets it, a page that needs nothing else."""

import dataclasses
import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.record.animation import Camera, Film, Shot, make_film, write_animation, write_page
from tests.host.record.machines import perfect_run

pytest.importorskip("matplotlib")

from PIL import Image, ImageSequence

from steptwin.host.record.animation.drawing import FilmDrawing, gif_durations_ms
from tests.messages import refusing

RUN = perfect_run("teaching-scara", "carry")
ISO = Camera.named("iso")
SHORT = Shot(fps=4.0, speed=0.25, to_s=0.5)


@pytest.fixture(scope="module")
def film() -> Film:
    return make_film(RUN, SHORT)


@pytest.fixture(scope="module")
def drawing(film: Film) -> FilmDrawing:
    return FilmDrawing(film, ISO, 321)


@pytest.mark.slow
def test_a_gif_has_every_frame_and_lasts_as_long(tmp_path: Path) -> None:
    done: list[float] = []
    film = write_animation(tmp_path / "arm.gif", RUN, ISO, SHORT, 320, done.append)
    with Image.open(tmp_path / "arm.gif") as image:
        assert image.size == (320, 240)
        assert image.info["loop"] == 0
        shown = [(frame.info["duration"], np.asarray(frame.convert("RGB"))) for frame in ImageSequence.Iterator(image)]
    durations_ms, frames = zip(*shown, strict=True)
    assert len(frames) == len(film.times_s) == 9
    assert durations_ms == (250,) * 8 + (1000,)
    assert all((one != other).any() for one, other in pairwise(frames))
    assert done == pytest.approx(np.arange(1, 10) / 9)
    assert [path.name for path in tmp_path.iterdir()] == ["arm.gif"]


@pytest.mark.parametrize("fps", [1.0, 7.0, 24.0, 30.0, 60.0, 100.0])
def test_durations_in_hundredths_of_a_second_do_not_drift(fps: float) -> None:
    ends_ms = np.cumsum(gif_durations_ms(200, fps))
    assert np.abs(ends_ms - 1e3 * np.arange(1, 201) / fps).max() <= 5.0


def test_frames_have_even_sizes_and_no_frame_depends_on_those_before(drawing: FilmDrawing) -> None:
    first = drawing.frame(0)
    assert first.shape == (240, 320, 4)
    assert (drawing.frame(5) != first).any()
    np.testing.assert_array_equal(drawing.frame(0), first)


@pytest.mark.parametrize("camera", ["top", "front", "side", "20,-30"])
def test_every_camera_keeps_the_arm_within_the_picture(film: Film, camera: str) -> None:
    """The frame's border shows background only; the ground's grid may end there."""
    picture = FilmDrawing(film, Camera.named(camera), 320).frame(4)[..., :3].astype(int)
    border = np.concatenate([picture[16:-16, 0], picture[16:-16, -1]])
    assert border.min() > 200
    assert picture[16:-16].min() < 100


FAKE_FFMPEG = """#!/bin/sh
printf '%s\\n' "$@" > {folder}/arguments
{body}
"""


def fake_ffmpeg(folder: Path, monkeypatch: pytest.MonkeyPatch, body: str) -> None:
    program = folder / "ffmpeg"
    program.write_text(FAKE_FFMPEG.format(folder=folder, body=body))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")


def test_ffmpeg_gets_every_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drawing: FilmDrawing) -> None:
    bin_folder = tmp_path / "bin"
    bin_folder.mkdir()
    fake_ffmpeg(bin_folder, monkeypatch, 'for last; do :; done; cat > "$last"')
    film = write_animation(tmp_path / "arm.mp4", RUN, ISO, SHORT, 321)
    data = np.frombuffer((tmp_path / "arm.mp4").read_bytes(), np.uint8).reshape(len(film.times_s), 240, 320, 4)
    np.testing.assert_array_equal(data[3], drawing.frame(3))
    words = (bin_folder / "arguments").read_text().split("\n")
    assert [words[words.index(option) + 1] for option in ("-s", "-r", "-c:v", "-i")] == ["320x240", "4", "libx264", "-"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm.mp4", "bin"]


def test_what_ffmpeg_complains_about_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bin_folder = tmp_path / "bin"
    bin_folder.mkdir()
    fake_ffmpeg(bin_folder, monkeypatch, "echo details >&2; echo Unknown encoder >&2; exit 8")
    with refusing(InputError):
        write_animation(tmp_path / "arm.mp4", RUN, ISO, SHORT, 320)
    assert [path.name for path in tmp_path.iterdir()] == ["bin"]


def test_without_ffmpeg_there_is_no_video(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with refusing(InputError):
        write_animation(tmp_path / "arm.mp4", RUN, ISO)


@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("arm.htm", 720),
        ("arm", 720),
        ("arm.gif", 239),
        ("arm.gif", 3841),
    ],
)
def test_other_files_are_refused(tmp_path: Path, name: str, width: int) -> None:
    with refusing(InputError):
        write_animation(tmp_path / name, RUN, ISO, SHORT, width)
    assert not list(tmp_path.iterdir())


def test_the_page_stands_alone_and_holds_the_film(tmp_path: Path, film: Film) -> None:
    write_page(tmp_path / "arm.html", film, Camera(-45.0, 20.0))
    text = (tmp_path / "arm.html").read_text(encoding="utf-8")
    assert "://" not in text
    assert "default-src 'none'" in text
    assert not re.search(r"<[^>]* (src|href)=", text)
    (stored,) = re.findall(r"const film = (\{.*\});", text)
    document = json.loads(stored)
    assert document["title"] == film.title
    assert document["camera"] == [-45.0, 20.0]
    assert document["times"] == pytest.approx(film.times_s)
    assert [part.name for part in film.marks] == ["axis th1", "axis th2", "axis d3", "axis th4"]
    for part, shown in zip((*film.parts, *film.marks), document["parts"], strict=True):
        assert (shown["name"], shown["role"]) == (part.name, part.role)
        assert np.array(shown["points"]) == pytest.approx(part.points_mm, abs=6e-4)
    counted_mm = np.array(document["planned"]) + 1e3 * np.array(document["errors"])
    assert counted_mm == pytest.approx(film.path.counted_mm(1e3)[1::2], abs=2e-3)
    assert document["until"][-1] * 2 == film.path_until[-1]


def test_names_cannot_end_the_pages_script(tmp_path: Path, film: Film) -> None:
    hostile = dataclasses.replace(film, title="</script><script>alert(1)</script>\u2028")
    write_page(tmp_path / "arm.html", hostile, ISO)
    text = (tmp_path / "arm.html").read_text(encoding="utf-8")
    assert text.count("<script") == text.count("</script") == 1
    assert "\u2028" not in text


def test_pulses_are_drawn_below_the_arm_and_change(tmp_path: Path) -> None:
    """A page, which has no pins, refuses them."""
    film = make_film(RUN, Shot(fps=4.0, pulses_ms=5.0))
    drawn = FilmDrawing(film, ISO, 480)
    early, late = drawn.frame(0), drawn.frame(len(film.times_s) // 4)
    rows = np.flatnonzero((early != late).any(axis=(1, 2)))
    assert rows.max() > 0.75 * early.shape[0]
    with refusing(InputError):
        write_animation(tmp_path / "arm.html", RUN, ISO, Shot(pulses_ms=5.0))
