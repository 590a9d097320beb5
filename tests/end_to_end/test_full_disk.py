"""Every command that writes files names the one that it could not write, and leaves none without its contents."""

import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from tests.run_pictures import with_pictures

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from steptwin.host.record.plots import RUN_PICTURES, picture

ROBOT = "teaching-scara"
TOGETHER = ("robot.toml", "trajectory.csv", "edges.npz", "bus.log", "shelf.json", "trace.vcd", "report.json")
WRITTEN = (*TOGETHER, *(f"{name}.png" for name in RUN_PICTURES))
"""The files of a run in the order in which they are written; the first of them appear together."""
POINTS = "t,th1,th2,d3,th4\n0,0,10,0,0\n0.2,-1,12,1,-2\n"


@contextmanager
def files_up_to(bytes_max: int) -> Iterator[None]:
    """Let the system refuse to make any file longer, as if the disk were full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_max, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def noise(*_: object) -> Figure:
    """Return a picture that is drawn in no time and whose file is long."""
    figure = Figure()
    figure.figimage(np.random.default_rng(1).random((200, 200, 3)))
    return figure


@pytest.fixture(autouse=True, scope="module")
def _drawn_at_once() -> Iterator[None]:
    """Draw other pictures than a run's, which take a second each: these tests are about the files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "draw_picture", noise)
        yield


@pytest.fixture(scope="module")
def points(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("points") / "points.csv"
    path.write_text(POINTS)
    return str(path)


@pytest.fixture(scope="module")
def stored(points: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stored")
    with with_pictures():
        assert run(["run", ROBOT, points, "--out", str(folder)]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("bytes_max", [0, 10_000, 35_000, 60_000])
def test_run(bytes_max: int, points: str, stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with files_up_to(bytes_max), with_pictures():
        assert run(["run", ROBOT, points, "--out", str(tmp_path)]) == 2
    name = next(name for name in WRITTEN if (stored / name).stat().st_size > bytes_max)
    assert_named(tmp_path / name, capsys)
    left = () if name in TOGETHER else WRITTEN[: WRITTEN.index(name)]
    assert [path.name for path in sorted(tmp_path.iterdir())] == sorted(left)
    assert_nothing_empty(tmp_path)


@pytest.mark.parametrize("bytes_max", [0, 10_000, 35_000])
def test_the_run_before_stays_whole(
    bytes_max: int, points: str, stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No file of a run that was not kept stands beside those of the run before."""
    out = tmp_path / "out"
    shutil.copytree(stored, out)
    with files_up_to(bytes_max), with_pictures():
        assert run(["run", ROBOT, points, "--out", str(out)]) == 2
    assert {path.name: path.read_bytes() for path in out.iterdir()} == {
        path.name: path.read_bytes() for path in stored.iterdir()
    }
    assert run(["verify", str(out)]) == 0
    assert "PASSED" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["plot", "--what", "error"], "error.png"),
        (["plot", "--what", "error", "--format", "svg"], "error.svg"),
        (["plot", "--what", "error", "--format", "pdf"], "error.pdf"),
        (["trace"], "trace.vcd"),
        (["trace", "--format", "vcd-full"], "trace-full.vcd"),
        (["trace", "--format", "csv"], "trace.csv"),
        (["trace", "--format", "npz"], "trace.npz"),
    ],
)
@pytest.mark.parametrize("bytes_max", [0, 4096])
def test_what_is_made_of_a_run(
    words: list[str], name: str, bytes_max: int, stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, *options = words
    out = tmp_path if command == "plot" else tmp_path / name
    with files_up_to(bytes_max):
        assert run([command, str(stored), *options, "--out", str(out)]) == 2
    assert_named(tmp_path / name, capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("bytes_max", "samples", "name"),
    [
        (0, "1000", "workspace.json"),
        (4096, "1000", "cloud.csv"),
        pytest.param(4096, "10", "workspace.png", marks=pytest.mark.slow),
    ],
)
def test_workspace(bytes_max: int, samples: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with files_up_to(bytes_max):
        assert run(["workspace", ROBOT, "--samples", samples, "--out", str(tmp_path)]) == 2
    assert_named(tmp_path / name, capsys)
    assert not (tmp_path / name).exists()
    assert_nothing_empty(tmp_path)


def assert_named(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that the one line on stderr names a file."""
    assert capsys.readouterr().err == f"steptwin: {path}: File too large\n"


def assert_nothing_empty(folder: Path) -> None:
    assert [path.name for path in folder.iterdir() if path.name.endswith(".part") or not path.stat().st_size] == []
