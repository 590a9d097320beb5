"""The wheel: one top-level name, the same contents from every kind of source, usable beside packages of any name."""

import os
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest

import steptwin
from steptwin.features.campaigns.sources import digest_of
from steptwin.features.kernel_c.layout import kernel_files
from tests.package.wheels import ROOT, build, contents, install, run_installed

pytestmark = pytest.mark.slow

OWN_PACKAGES = ["bench", "controller", "emulator", "features", "host", "protocol"]
"""StepTwin's folders, whose names a user's project may give to packages of its own."""
OWN_TEST = """
import pytest

import bench, controller, emulator, host, protocol
from steptwin.controller.motion.backend import Kernel, python_kernel


@pytest.fixture(scope="session")
def steptwin_kernel() -> Kernel:
    return python_kernel()  # starts at once, without the compiler


@pytest.mark.steptwin("lab-scara", stand_at={"th2": 10.0})
def test_both(steptwin_board):
    assert [each.OWNER for each in (bench, controller, emulator, host, protocol)] == ["the project"] * 5
    steptwin_board.wait(0.1)
    assert steptwin_board.joints()["th2"] == pytest.approx(10.0, abs=0.03)
"""


def test_the_wheel_has_one_top_level_name(wheel: Path) -> None:
    top_level = {name.partition("/")[0] for name in contents(wheel)}
    assert top_level == {"steptwin", f"steptwin-{steptwin.__version__}.dist-info"}


def test_the_wheel_is_for_every_machine(wheel: Path) -> None:
    """Only who asks for it compiles."""
    assert wheel.name == f"steptwin-{steptwin.__version__}-py3-none-any.whl"


def test_what_a_wheel_for_speed_compiles_exists() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    hook = project["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]
    assert hook["modules"] == sorted(set(hook["modules"]))
    assert all((ROOT / module).is_file() for module in hook["modules"])
    assert {module.partition("/")[0] for module in hook["modules"]} <= set(hook["folders"])


def test_the_wheel_has_every_module_of_the_checkout(wheel: Path) -> None:
    packed = [folder for folder in OWN_PACKAGES if folder != "bench"]
    modules = {path.relative_to(ROOT) for folder in packed for path in (ROOT / folder).rglob("*.py")}
    names = set(contents(wheel))
    assert {f"steptwin/{module.as_posix()}" for module in modules} <= names
    assert {"steptwin/__main__.py", "steptwin/py.typed", "steptwin/features/papers/robots/lab-scara.toml"} <= names
    assert {f"steptwin/features/kernel_c/{name}" for name in kernel_files()} <= names


def test_the_wheel_has_no_benchmarks(wheel: Path) -> None:
    """They measure a checkout."""
    assert not [name for name in contents(wheel) if name.startswith("steptwin/bench")]


def test_the_wheel_has_the_digest_of_the_checkout(wheel: Path, tmp_path: Path) -> None:
    with ZipFile(wheel) as file:
        file.extractall(tmp_path)
    assert digest_of(tmp_path / "steptwin") == digest_of(ROOT / "steptwin")


def test_the_wheel_from_an_sdist_is_the_same(wheel: Path, tmp_path: Path) -> None:
    sdist = build("sdist", ROOT, tmp_path / "sdist")
    with tarfile.open(sdist) as file:
        if hasattr(tarfile, "data_filter"):  # early releases of Python 3.11 know no filters
            file.extraction_filter = tarfile.data_filter
        file.extractall(tmp_path)
    source = tmp_path / sdist.name.removesuffix(".tar.gz")
    assert contents(build("wheel", source, tmp_path / "wheel")) == contents(wheel)


def test_a_clone_without_links_gives_a_working_wheel(tmp_path: Path) -> None:
    """Without link support, as on Windows, git writes each link as a file that contains the link's target."""
    if not (ROOT / ".git").exists():
        pytest.skip("this is not a clone")
    clone = tmp_path / "clone"
    subprocess.run(["git", "-c", "core.symlinks=false", "clone", "--quiet", ROOT, clone], check=True)
    assert (clone / "steptwin" / "host").read_text() == "../host"
    assert "lab-scara" in run_installed(clone, "-m", "steptwin", "robots", cwd=tmp_path)  # as an editable install does
    installed = install(build("wheel", clone, tmp_path / "wheel"), tmp_path / "installed")
    assert "lab-scara" in run_installed(installed, "-m", "steptwin", "robots", cwd=tmp_path)


def test_the_package_runs_as_a_module(installed: Path, tmp_path: Path) -> None:
    """The wheel runs, not the checkout."""
    assert "lab-scara" in run_installed(installed, "-m", "steptwin", "robots", cwd=tmp_path)
    where = run_installed(installed, "-c", "import steptwin; print(steptwin.__file__)", cwd=tmp_path)
    assert where == f"{installed / 'steptwin' / '__init__.py'}\n"


def test_a_project_with_packages_of_the_same_names(installed: Path, tmp_path: Path) -> None:
    """A test imports the project's packages and uses the fixture `steptwin_board`."""
    for name in OWN_PACKAGES:
        package = tmp_path / name
        package.mkdir()
        (package / "__init__.py").write_text('OWNER = "the project"\n')
    (tmp_path / "test_own.py").write_text(OWN_TEST)
    printed = run_installed(installed, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "error", cwd=tmp_path)
    assert printed.splitlines()[-1].startswith("1 passed")


def test_coverage_is_measured_through_the_links(tmp_path: Path) -> None:
    """The report names the real files, also those that no test imports; below the limit the run fails."""
    options = ["-p", "no:cacheprovider", "--cov=steptwin.controller", "--cov=steptwin.protocol", "--cov-fail-under=95"]
    command = [sys.executable, "-m", "pytest", "-q", "tests/protocol/test_homing_methods.py", *options]
    environment = os.environ | {"COVERAGE_FILE": str(tmp_path / "coverage")}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    cover = {line.split()[0]: line.split()[-1] for line in done.stdout.splitlines() if ".py" in line}
    assert cover["protocol/homing_methods.py"] == "100%"
    assert cover["controller/node/firmware.py"] == "0%"
    assert done.returncode == 1
    assert "less than fail-under=95" in done.stdout
