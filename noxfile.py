"""Run the tests on other Pythons, on what is built instead of the checkout, and with the lowest libraries: `nox`.

`nox -l` lists the sessions; a Python that is not installed is skipped. `make test-all` tests the checkout itself.
"""

import sys
from pathlib import Path
from typing import Final

import nox

PYTHONS: Final = ("3.11", "3.12", "3.13", "3.14")
EXTRAS: Final = "[fast,plot,mcap,campaign,panel]"
WITHOUT_PROCESSES: Final = ("tests/protocol", "tests/controller", "tests/emulator", "tests/host")
"""What every Python and everything built must pass, but for slow tests; tests of whole commands are the checkout's."""

nox.options.sessions = ["tests", "built", "lowest", "types"]
nox.options.default_venv_backend = "venv"


def _temporary(session: nox.Session) -> Path:
    return Path(session.create_tmp()).resolve()


def _pytest(session: nox.Session, *options: str, **environment: str) -> None:
    """Run the tests, or those that are named behind `--`; each session's numba keeps its code apart."""
    session.run(
        *("python", "-P", "-m", "pytest", "--numprocesses", "auto", "--dist", "worksteal", *options),
        *(session.posargs or ["-m", "not slow and not live", *WITHOUT_PROCESSES]),
        env={"OPENBLAS_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(_temporary(session) / "numba"), **environment},
    )


def _install_tools(session: nox.Session) -> None:
    session.install("--upgrade", "pip>=25.1")  # the first that knows dependency groups
    session.install("--group", "dev")


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Test the checkout on each Python with the newest libraries; run the README's job."""
    _install_tools(session)
    session.install("--editable", f".{EXTRAS}")
    session.run("steptwin", "run", "warehouse-scara", "drawer-pull")
    _pytest(session)


@nox.session
@nox.parametrize("target", ["wheel", "sdist"])
def built(session: nox.Session, target: str) -> None:
    """Test the built wheel, and one that is made of the built sdist, by the checkout's tests."""
    _install_tools(session)
    session.install(f".{EXTRAS}")  # what it needs
    folder = _temporary(session)
    session.run(*("python", "-m", "hatchling", "build", "--target", target, "--directory", str(folder / target)))
    (package,) = (folder / target).iterdir()
    site = folder / f"{target}-site"
    session.install("--no-deps", "--upgrade", "--target", str(site), str(package))
    paths = f"{site}{';' if sys.platform == 'win32' else ':'}{Path.cwd()}"
    told = session.run(
        "python", "-P", "-c", "import steptwin; print(steptwin.__file__)", env={"PYTHONPATH": paths}, silent=True
    )
    if not str(told).startswith(str(site)):
        session.error(f"the tests would run on {told}")
    _pytest(session, "--import-mode", "importlib", PYTHONPATH=paths)


@nox.session
def lowest(session: nox.Session) -> None:
    """Test with the lowest versions that pyproject.toml allows, as `make test-lowest` does."""
    session.run("make", "test-lowest", f"LOWEST={session.create_tmp()}/lowest", external=True)


@nox.session
def types(session: nox.Session) -> None:
    """Check that every public name of the installed package has a known type, by another checker than `make lint`."""
    session.install(f".{EXTRAS}", "basedpyright", "scipy-stubs")
    session.run("basedpyright", "--verifytypes", "steptwin", "--ignoreexternal")
