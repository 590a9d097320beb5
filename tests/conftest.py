"""Fixtures that every test may use."""

import gc
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any, Final

import pytest
from hypothesis import settings

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.cli.app import run
from steptwin.host.robots import workspace
from steptwin.host.robots.robot import Robot
from tests.kernel_forms import FORMS, kernel_form
from tests.run_pictures import without_pictures
from tests.shared_folders import made_once

pytest_plugins = ["tests.budget", "tests.messages", "tests.repeats", "tests.turns"]

YOUNG_OBJECTS: Final = 200_000
"""Number of new objects between two collections of garbage: the usual 700 take much longer, and so do 50 000."""
TESTS: Final = Path(__file__).resolve().parent

ON_LINUX: Final = sys.platform.startswith("linux")
collect_ignore_glob = (
    []
    if ON_LINUX
    else [
        "live/*",
        *(f"end_to_end/test_{name}.py" for name in ("bounded_planning", "full_disk", "hostile_files", "interrupts")),
        "features/panel/page/test_planning_apart.py",
    ]
)
"""Tests that stop processes, limit what they may use, or look at them in /proc, as only Linux lets a test do."""

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a shell's background: programs would never be interrupted
    signal.signal(signal.SIGINT, signal.default_int_handler)

# No timing is asserted in a test, not even by the framework; and every run draws the same examples, so that a change
# is judged by what it changed. `pytest --hypothesis-profile=explore` draws new ones.
settings.register_profile("steptwin", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("steptwin")


def pytest_report_header() -> str:
    """Say which tests this system leaves out."""
    return "" if ON_LINUX else f"not Linux: left out are {', '.join(collect_ignore_glob)}"


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Let the first of several workers compile the kernel and the others the tests, so that nothing is compiled twice.

    Compiling takes pytest most of a first collection, as it writes its assertions anew.
    """
    gc.disable()
    worker: dict[str, Any] = getattr(session.config, "workerinput", {})
    if not worker or TESTS not in {Path(path).resolve() for path in session.config.args}:
        return
    number, others = int(worker["workerid"][2:]) - 1, worker["workercount"] - 1
    if number < 0:
        fastest_kernel()
    left_out = [Path(path).resolve() for path in session.config.getoption("ignore") or ()]
    paths = [path for path in sorted(TESTS.rglob("test_*.py")) if not {path, *path.parents} & set(left_out)]
    for path in paths[number::others] if number >= 0 else ():
        with suppress(Exception, pytest.skip.Exception):  # the collection tells
            import_module(".".join(path.relative_to(TESTS.parent).with_suffix("").parts))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark all tests of tests/live."""
    for item in items:
        if item.path.is_relative_to(TESTS / "live"):
            item.add_marker(pytest.mark.live)


def pytest_collection_finish() -> None:
    """Spare the garbage collector what lives as long as the session: tests of pages collect all of it twice each."""
    gc.freeze()
    gc.set_threshold(YOUNG_OBJECTS)
    gc.enable()


@pytest.fixture(autouse=True, scope="module")
def _no_pictures() -> Iterator[None]:
    """Leave the pictures of each run's folder out, but where a test asks for them by `with_pictures`."""
    with without_pictures():
        yield


@pytest.fixture(autouse=True)
def _same_tokens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give hosts the same tokens in each run of a test: a frame's stuffed bits, and so its time, depend on them."""
    monkeypatch.setattr("secrets.randbelow", Random(1).randrange)


@pytest.fixture(autouse=True, scope="session")
def _each_workspace_once() -> Iterator[None]:
    """Let commands that compute the same workspace again, which takes a second, get it from the first."""
    scan = workspace.scan
    scans: dict[object, workspace.Scan] = {}

    def scan_once(robot: Robot, attitude_deg: float | None = None, z_mm: float | None = None) -> workspace.Scan:
        arm = robot.name, robot.kinematics, robot.geometry, robot.home, robot.base
        key = repr(arm), *((joint.name, joint.lower, joint.upper) for joint in robot.joints), attitude_deg, z_mm
        if key not in scans:
            scans[key] = scan(robot, attitude_deg, z_mm)
        return scans[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workspace, "scan", scan_once)
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--kernel NAME`, with which the tests of the firmware run on one form of the kernel, as on a Cortex-M3."""
    parser.addoption("--kernel", choices=[*FORMS], help="form of the kernel that the fixtures give")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Give a test of the kernel the one that is asked for, or else all its forms in turn."""
    if "kernel" in metafunc.fixturenames:
        chosen = metafunc.config.getoption("--kernel")
        metafunc.parametrize("kernel", [chosen] if chosen else [*FORMS], indirect=True)


@pytest.fixture
def kernel(request: pytest.FixtureRequest) -> Kernel:
    """Return a form of the kernel, where it is installed."""
    return kernel_form(request.param)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the client wait hardly for answers to SDO requests: in virtual time they are there at once or never."""
    monkeypatch.setattr("steptwin.host.client.shared_node._PATIENCE_S", 0.01)
    monkeypatch.setattr("steptwin.host.client.shared_node._IMPATIENCE_S", 0.01)


@pytest.fixture(scope="session")
def fast_kernel(request: pytest.FixtureRequest) -> Kernel:
    """Return the fastest installed kernel, or the one that is asked for, for tests that do not depend on its form."""
    chosen: str | None = request.config.getoption("--kernel")
    return FORMS[chosen]() if chosen else fastest_kernel()


@pytest.fixture(scope="session")
def stored_run(tmp_path_factory: pytest.TempPathFactory, fast_kernel: Kernel) -> Path:
    """Return the folder of `run warehouse-scara store`: 31 s with pauses, in which outputs switch."""
    return _written(tmp_path_factory, "store", fast_kernel, ["warehouse-scara", "store"])


@pytest.fixture(scope="session")
def carry_run(tmp_path_factory: pytest.TempPathFactory, fast_kernel: Kernel) -> Path:
    """Return the folder of `run teaching-scara carry`: a fast motion of 1 s."""
    return _written(tmp_path_factory, "carry", fast_kernel, ["teaching-scara", "carry"])


@pytest.fixture(scope="session")
def cut_run(tmp_path_factory: pytest.TempPathFactory, fast_kernel: Kernel) -> Path:
    """Return the folder of `carry` with a host that hangs after half of its points: a run that ends in fault."""
    words = ["teaching-scara", "carry", "--cut-stream", "0.5"]
    return _written(tmp_path_factory, "cut", fast_kernel, words, exit_code=3)


def _written(
    factory: pytest.TempPathFactory, name: str, kernel: Kernel, words: Sequence[str], exit_code: int = 0
) -> Path:
    """Run a job and write its folder without pictures, which would take longest."""

    def write(folder: Path) -> None:
        with without_pictures():
            assert run(["run", *words, "--kernel", kernel.name, "--out", str(folder)]) == exit_code

    return made_once(factory, name, write)


@pytest.fixture(scope="session")
def store_run(tmp_path_factory: pytest.TempPathFactory, fast_kernel: Kernel) -> Path:
    """Return the folder of a quick `run warehouse-scara store`: 9 s, in which outputs switch and the shelf is told."""
    words = ["run", "warehouse-scara", "store", "-o", "pull_s=1", "-o", "approach_mm=5", "-o", "law=fastest"]

    def write(folder: Path) -> None:
        with without_pictures():
            assert run([*words, "--kernel", fast_kernel.name, "--out", str(folder)]) == 0

    return made_once(tmp_path_factory, "store-quick", write)
